"""`capsule replay`: the controller runs again on what a log received, and its frames are compared bit by bit."""

import math
import struct
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Final

import can

import models.effects
from hil.app.console import answer, note, output_to_notes
from hil.app.run.log_task import TEXT, task_of
from hil.app.run.native_replay import Difference, Replay, native_replay
from hil.app.shared_options import Json, OwnControllers, OwnEffects, argument
from hil.bus.catalogue import FrameCatalogue, load_catalogue
from hil.log.blf_file import LOST, NOTED, RECEIVED, Logged
from hil.log.place import FORMAT, record_path
from hil.log.reader import read_frames, read_log_record
from hil.log.recorder import ACKNOWLEDGED, CUT, EXACT, HEARD, START, STOP, UNSOLVED, code_version
from hil.nodes.node import ControllerNode
from hil.nodes.task import Task
from models.files.toml import shown

_SHOWN: Final = 5  # differences on the terminal


class Tape(can.BusABC):
    """A bus that delivers what a log holds, at the log's times, and keeps what is sent."""

    def __init__(self) -> None:
        super().__init__(channel="tape")
        self.inbox: deque[can.Message] = deque()
        self.sent: list[tuple[int, bytes]] = []

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.sent.append((msg.arbitration_id, bytes(msg.data)))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return (self.inbox.popleft() if self.inbox else None), True


@dataclass
class TickOfLog:
    """A tick of the log: time, frames sent and received, whether solved, after how many steps the plan was cut."""

    time_s: float
    sent: list[tuple[int, bytes]] = field(default_factory=list)
    heard: list[can.Message] = field(default_factory=list)
    solved: bool = True
    cut_after: int | None = None


@dataclass(frozen=True)
class Order:
    """An order of the operator between ticks, `code` as the recorder notes it."""

    code: int
    time_s: float
    value: float


def replay(
    path: Annotated[Path, argument("LOG")],
    *,
    json_output: Json = False,
    effects: OwnEffects,
    controllers: OwnControllers,
) -> int:
    """Run the controller of a log again; 0 where the log is complete and all its frames are the same, else 1."""
    if path.suffix.lower() != ".blf":
        found, whole = native_replay(path)
        _begun(path, found)
        return _print(path, found, load_catalogue(), "" if whole else TEXT("replay.killed"), None, json_output)
    known = models.effects.Catalogue.read(effects)
    record, catalogue = read_log_record(path), load_catalogue()
    held = 0

    def counted() -> Iterator[Logged]:
        nonlocal held
        for frame in read_frames(path, lambda said: note(f"{path}: {said}")):
            held += 1
            yield frame

    try:
        for key, own in (("format", FORMAT), ("catalogue", catalogue.fingerprint)):
            if record.get(key) != own:
                raise ValueError(f"{key} must be {own}, as in this program; got {shown(record.get(key))}")
        with output_to_notes():
            task = task_of(record, str(path), known)
            found = replayed(counted(), task, catalogue, record.get("dry_run", False))
    except ValueError as error:
        raise ValueError(str(error) if str(error).startswith(str(path)) else f"{record_path(path)}: {error}") from None
    _begun(path, found)
    entries = record.get("entries")
    cut_off = "" if held == entries else TEXT("replay.incomplete", held=held, entries=entries)
    cut_off = TEXT("replay.no_end") if entries is None else cut_off
    return _print(path, found, catalogue, cut_off, str(record.get("code", "unknown")), json_output)


def _begun(path: Path, found: Replay) -> None:
    if not found.ticks:
        raise ValueError(
            f"{path}: log must hold ticks of its controller, each begun by a SYNC that it sent; got none: it is empty"
            " or recorded by another node"
        )


def _print(
    path: Path, found: Replay, catalogue: FrameCatalogue, cut_off: str, written: str | None, json_output: bool
) -> int:
    """Say what a replay of a log of the code `written` (None: that of its folder) found; the status."""
    code = (written or code_version(), code_version())
    lines = [difference.words(catalogue) for difference in found.differences[:_SHOWN]]
    document = {
        "log": str(path),
        "identical": found.identical and not cut_off,
        "cut_off": cut_off or None,
        "ticks": found.ticks,
        "frames": found.frames,
        "cut_ticks": found.cut,
        "different_ticks": len(found.differences),
        "differences": lines,
        "code": list(code),
    }
    if not found.identical and code[0] != code[1]:
        lines = [*lines, TEXT("replay.code", log=code[0], now=code[1])]
    result = "different" if not found.identical else "as_far" if cut_off else "identical"
    said = TEXT(f"result.{result}", count=len(found.differences)) + (f"; {cut_off}" if cut_off else "")
    answer(json_output, document, TEXT("replay.found", ticks=found.ticks, frames=found.frames, result=said), *lines)
    return 0 if found.identical and not cut_off else 1


def replayed(frames: Iterable[Logged], task: Task, catalogue: FrameCatalogue, dry_run: bool = False) -> Replay:
    """The controller of `task` on the `frames` of a log; the last tick is compared as far as the log holds it."""
    tape = Tape()
    sent: list[tuple[int, bytes]] = tape.sent

    def keep(message: can.Message) -> None:
        if dry_run and not message.is_rx:
            sent.append((message.arbitration_id, bytes(message.data)))

    ticks = count = cut = 0
    differences: list[Difference] = []
    with tape:
        node = ControllerNode(task, tape, observer=keep, dry_run=dry_run)
        events = list(ticks_of(frames, catalogue["Sync"].id))
        last = next((k for k in range(len(events) - 1, -1, -1) if isinstance(events[k], TickOfLog)), -1)
        for k, event in enumerate(events):
            if isinstance(event, Order):
                if event.code == START:
                    node.start(event.time_s, None if math.isnan(event.value) else event.value)
                elif event.code == STOP:
                    node.stop()
                elif event.code == ACKNOWLEDGED:
                    node.acknowledge()
                continue
            sent.clear()
            tape.inbox.extend(event.heard)
            node.supervisor.allow(event.cut_after)
            node.tick(event.time_s, event.solved)
            tape.inbox.clear()
            ticks, count, cut = ticks + 1, count + len(sent), cut + (event.cut_after is not None)
            computed = sent[: len(event.sent)] if k == last else sent
            if computed != event.sent:
                differences.append(Difference(ticks, event.time_s, tuple(event.sent), tuple(sent)))
    return Replay(ticks, count, cut, tuple(differences))


def ticks_of(frames: Iterable[Logged], sync: int) -> Iterator[TickOfLog | Order]:
    """Ticks and orders of a log; a tick heard the frames from the SYNC before to its own. ValueError for gaps."""
    tick: TickOfLog | None = None
    exact: float | None = None
    solved, heard_before = True, False
    waiting: list[can.Message] = []
    for logged in frames:
        if logged.direction == NOTED and logged.id in (EXACT, UNSOLVED, HEARD, LOST, CUT):
            value = struct.unpack("<d", logged.data)[0]
            if logged.id == LOST:
                raise ValueError(f"log must be whole to be replayed; frames are missing at {logged.time_s:g} s")
            exact = value if logged.id == EXACT else exact
            solved, heard_before = solved and logged.id != UNSOLVED, heard_before or logged.id == HEARD
            if logged.id == CUT and tick is not None and math.isfinite(value):
                tick.cut_after = int(value)
            continue
        time_s, exact = logged.time_s if exact is None else exact, None
        if logged.direction == NOTED:
            if tick is not None:
                yield tick
            tick = None
            yield Order(logged.id, time_s, struct.unpack("<d", logged.data)[0])
        elif logged.direction == RECEIVED:
            message = can.Message(time_s, logged.id, False, data=logged.data, is_rx=True)
            (waiting if tick is None or not heard_before else tick.heard).append(message)
            heard_before = False
        else:
            if logged.id == sync:
                if tick is not None:
                    yield tick
                tick, solved = TickOfLog(time_s, heard=waiting, solved=solved), True
                waiting = []
            if tick is not None:
                tick.sent.append((logged.id, logged.data))
    if tick is not None:
        yield tick
