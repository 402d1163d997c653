"""The log entries of a controller node: all frames in its order, the operator's actions, exact times."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from subprocess import TimeoutExpired, run
from typing import Any, Final, NamedTuple

import can

from controller.limits import Limits
from controller.signals import Action
from controller.step.library import available
from hil.bus.catalogue import FrameCatalogue
from hil.log.blf_file import LATEST_S, NOTED, RECEIVED, SENT, WITHHELD, Logged
from hil.log.log import NodeLog
from hil.own_process import version_of
from models.theta import Theta

START, STOP, UNSOLVED, CUT, EXACT, HEARD, ACKNOWLEDGED = range(1, 8)
"""Notes in a log. `START`: the operator's start (value: origin of the reference in s; nan: it begins as the drive is
enabled). `STOP`: the operator's stop. `UNSOLVED`: a tick without a solution. `CUT`: the steps after which the clock cut
the previous tick's plan. `EXACT`: the true time of the next entry, if the log rounds it. `HEARD`: the next frame was
received by the tick before it. `ACKNOWLEDGED`: the operator acknowledged a fault. `LOST`: frames are missing here.
"""
_GIT_S: Final = 5  # for which git may run


class Recorder:
    """The observer of a controller node. It writes in order of time; at a tick's end first the frames that the tick
    received, then those that it sent. A note marks frames that arrived after the tick's begin and times that the log
    cannot hold, so that a replay has the node's order and each time to the last bit.
    """

    def __init__(self, log: NodeLog, dry_run: bool = False) -> None:
        self.log, self._dry = log, dry_run
        self._tick: list[_Entry] = []
        self._before: list[_Entry] = []
        self._began_s, self._last_s = -math.inf, 0.0
        log.before_close = self.flush

    def __call__(self, message: can.Message) -> None:
        if message.is_rx:
            self._tick.append(_Entry(message.timestamp, RECEIVED, message.arbitration_id, bytes(message.data)))
            return
        if message.timestamp != self._began_s:
            self.flush()
            self._tick, self._before, self._began_s = self._before, [], message.timestamp
        direction = WITHHELD if self._dry else SENT
        self._tick.append(_Entry(message.timestamp, direction, message.arbitration_id, bytes(message.data)))

    def note(self, now: float, code: int, value: float = 0.0) -> None:
        """Write a note; call it just before the node's own call: `START` with the origin in s (nan: without one) before
        `start`, `STOP` before `stop`, `ACKNOWLEDGED` before `acknowledge`.
        """
        self.flush()
        self._write([_Entry(now, NOTED, code, _value(value))])

    def unsolved(self, now: float) -> None:
        """Call just before `ControllerNode.tick(now, solved=False)`."""
        self._before.append(_Entry(now, NOTED, UNSOLVED, _value(0.0)))

    def ticked(self, now: float, action: Action) -> None:
        """Call after a tick at `now`; a replay cuts its plan where the clock did."""
        self.flush()
        if action.cut_after is not None:
            self.note(now, CUT, action.cut_after)

    def flush(self) -> None:
        entries, self._tick = self._tick, []
        heard = [entry for entry in entries if entry.direction == RECEIVED]
        own = [entry for entry in entries if entry.direction != RECEIVED]
        sent = any(entry.direction != NOTED for entry in own)  # else the bus took nothing: the next tick hears this
        late = next((k for k, entry in enumerate(heard) if sent and entry.time_s > self._began_s), len(heard))
        self._write([*heard[:late], *own], heard[late:])

    def _write(self, entries: list[_Entry], after: Sequence[_Entry] = ()) -> None:
        """Write entries with their notes; those of `after` were received after the tick had sent."""
        frames: list[Logged] = []
        for k, entry in enumerate([*entries, *after]):
            if not abs(entry.time_s) <= LATEST_S:
                self.log.dropped += 1
                continue
            self._last_s = max(entry.time_s, self._last_s)
            time_ns = round(self._last_s * 1e9)
            if k >= len(entries):
                frames.append(Logged(time_ns, HEARD, _value(0.0), NOTED))
            if time_ns / 1e9 != entry.time_s:
                frames.append(Logged(time_ns, EXACT, _value(entry.time_s), NOTED))
            frames.append(Logged(time_ns, entry.id, entry.data, entry.direction))
        self.log.put(frames)


def _value(value: float) -> bytes:
    return struct.pack("<d", value)


class _Entry(NamedTuple):
    """A frame or note at `time_s` of the node."""

    time_s: float
    direction: int
    id: int
    data: bytes


def log_record(
    described: Mapping[str, str], controller: str, values: Theta, limits: Limits, catalogue: FrameCatalogue, **more: Any
) -> dict[str, Any]:
    """The record beside a log, from which `capsule replay` builds the same controller; `described`: a file's text."""
    return {
        **described,
        "controller": controller,
        "values": values.spelled(),
        "limits": asdict(limits),
        "catalogue": catalogue.fingerprint,
        "code": code_version(),
        "in_c": available(),
        **more,
    }


def code_version() -> str:
    """The program's version and, in a checkout, its commit, with "+" if files differ from it."""
    number, commit = version_of(), _git("rev-parse", "--short=12", "HEAD")
    return f"{number} {commit}{'+' if _git('status', '--porcelain', '-uno') else ''}" if commit else number


def _git(*words: str) -> str:
    try:
        done = run(["git", *words], cwd=Path(__file__).parent, capture_output=True, text=True, timeout=_GIT_S)
    except (OSError, TimeoutExpired, ValueError):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
