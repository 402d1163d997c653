"""Sources of frames for the page: a bus that is only read, or a log."""

from collections.abc import Iterable
from typing import Any, Final

import can
import numpy as np

from hil.app.cockpit.panels import Facts
from hil.app.cockpit.series import LineFeed, Ring, Samples
from hil.app.cockpit.watch import FrameWatch
from hil.app.run.clock import Clock
from hil.app.system import error_text
from hil.bus.wrapping import plain
from hil.log.blf_file import NOTED, Logged
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
BUSY_S: Final = 0.02
"""Longest time to read frames for one picture; further frames wait for the next one."""
QUIET_S: Final = 0.5  # without a frame, after which the page reports it
AWAY_S: Final = 0.25
"""After such a pause of this process the queue of a bus may have overflowed."""
SNAPSHOTS: Final = 2000  # of a log's state at most
LOG_EVENTS: Final = 5000  # of a log that are kept
SHORTEST_S: Final = 0.1  # between two snapshots
CALENDAR_S: Final = 1e6  # a later stamp is a date


class BusSource:
    """Frames of `bus`, with times of `clock`, up to the last `poll`."""

    def __init__(self, bus: can.BusABC, clock: Clock, facts: Facts) -> None:
        self.bus, self.clock, self.facts = bus, clock, facts
        self.watch = FrameWatch(facts.catalogue)
        self.ring = Ring(_feed(facts))
        self._trouble, self._heard, self._polled = "", -1.0, clock.now()

    def poll(self) -> None:
        """Read the frames since the last call; a bus that raises is reported and tried again."""
        until, waits = self.clock.now() + BUSY_S, True
        try:
            while waits and self.clock.now() < until:
                message = self.bus.recv(0)
                waits = message is not None
                if message is not None and plain(message):
                    self._take(message)
            self._trouble = ""
        except Exception as error:  # noqa: BLE001 - drivers of many makers raise whatever they like
            waits = False
            self._trouble = TEXT("source.unreadable", why=error_text(error, 160))
        now = self.clock.now()
        if now - self._polled > AWAY_S:
            self.say(TEXT("source.away", seconds=now - self._polled), "doubt")
        self._polled = now
        reached = max(self._heard, 0.0) if waits else now
        self.watch.tick(reached)
        self.ring.close(reached)

    def say(self, words: str, grade: str = "note") -> None:
        self.watch.say(self.clock.now(), words, grade)

    def _take(self, message: can.Message) -> None:
        self._heard = message.timestamp
        good = self.watch.take(message.timestamp, message.arbitration_id, bytes(message.data))
        if good is not None:
            self.ring.add(message.timestamp, good[0], self.watch.last)

    def document(self) -> dict[str, Any]:
        now = self.clock.now()
        quiet = now - self._heard
        heard = TEXT("source.silent") if self._heard < 0 else TEXT("source.quiet", seconds=quiet)
        trouble = self._trouble or (heard if self._heard < 0 or quiet > QUIET_S else "")
        return {**self.watch.document(), "time_s": round(now, 3), "trouble": trouble}


class LogSource:
    """A whole log: all samples of its lines, and the state at `SNAPSHOTS` times at most."""

    def __init__(self, frames: Iterable[Logged], facts: Facts, ended: str = "") -> None:
        """Raises ValueError where the `frames` do; `ended` says how the run of the log ended."""
        self.facts, self.watch = facts, FrameWatch(facts.catalogue, LOG_EVENTS)
        self.samples = Samples(_feed(facts))
        self.end_s = 0.0
        self._times, self._states = list[float](), list[dict[str, Any]]()
        self._every = SHORTEST_S
        self._take(frames)
        self._keep(self.end_s)
        if ended:
            self.watch.say(self.end_s, TEXT("event.run_ended", ended=ended))

    def _take(self, frames: Iterable[Logged]) -> None:
        origin: float | None = None
        for frame in frames:
            if frame.direction == NOTED:
                continue
            if origin is None:
                origin = frame.time_s if frame.time_s > CALENDAR_S else 0.0
            now = max(frame.time_s - origin, self.end_s)
            if not self._times or now - self._times[-1] >= self._every:
                self.watch.tick(now)
                self._keep(now)
            self.end_s = now
            good = self.watch.take(now, frame.id, frame.data)
            if good is not None:
                self.samples.add(now, good[0], self.watch.last)

    def _keep(self, now: float) -> None:
        """Keep the state at `now`; where there are too many, every second one is dropped."""
        self._times.append(now)
        self._states.append(self.watch.document())
        if len(self._times) > SNAPSHOTS:
            self._times, self._states, self._every = self._times[::2], self._states[::2], 2 * self._every

    def window(self, begin_s: float, end_s: float, pixels: int) -> bytes:
        """The lines from `begin_s` to `end_s` as `hil.app.cockpit.series.packed`."""
        return self.samples.window(begin_s, end_s, pixels)

    def document(self, time_s: float) -> dict[str, Any]:
        """The last state kept before `time_s`."""
        k = max(int(np.searchsorted(self._times, time_s, "right")) - 1, 0)
        return {**self._states[k], "time_s": time_s, "trouble": ""}


def _feed(facts: Facts) -> LineFeed:
    return LineFeed([line for panel in facts.panels() for line in panel.lines], facts.catalogue)
