"""`capsule replay`: the controller once more on what a log heard, its frames compared bit by bit with the log."""

import math
import struct
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final

import can

import models.effects
from hil.app.console import answer, note, output_to_notes
from hil.app.run.log_task import task_of
from hil.app.shared_options import Json, OwnControllers, OwnEffects, argument
from hil.bus.catalogue import FrameCatalogue, load_catalogue
from hil.log.blf_file import LOST, NOTED, RECEIVED, Logged
from hil.log.place import FORMAT, record_path
from hil.log.reader import read_frames, read_log_record
from hil.log.recorder import ACKNOWLEDGED, CUT, EXACT, HEARD, START, STOP, UNSOLVED, code_version
from hil.nodes.controller.node import ControllerNode, Task
from models.files.toml import shown

_SHOWN: Final = 5  # differences on the terminal


class Tape(can.BusABC):
    """A bus that gives what a log holds, at the times that the log holds, and keeps what is sent."""

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
    """A tick of the log: time, frames in and out, whether solved, after how many steps the clock cut it."""

    time_s: float
    sent: list[tuple[int, bytes]] = field(default_factory=list)
    heard: list[can.Message] = field(default_factory=list)
    solved: bool = True
    cut_after: int | None = None


@dataclass(frozen=True)
class Word:
    """An operator's word between ticks."""

    code: int
    time_s: float
    value: float


@dataclass(frozen=True)
class Difference:
    """A tick whose frames are not those of the log: (identifier, data) as logged and as computed."""

    tick: int
    time_s: float
    logged: tuple[tuple[int, bytes], ...]
    computed: tuple[tuple[int, bytes], ...]

    def words(self, catalogue: FrameCatalogue) -> str:
        names = catalogue.by_id()

        def shown(frames: tuple[tuple[int, bytes], ...], k: int) -> str:
            if k >= len(frames):
                return "nothing"
            number, data = frames[k]
            return f"{names[number].name if number in names else hex(number)} {data.hex()}"

        k = next(
            k
            for k in range(max(len(self.logged), len(self.computed)))
            if self.logged[k : k + 1] != self.computed[k : k + 1]
        )
        return (
            f"tick {self.tick} at {self.time_s:.6f} s: logged {shown(self.logged, k)}, computed"
            f" {shown(self.computed, k)}"
        )


@dataclass(frozen=True)
class Replay:
    """What a replay found; plans of `cut` ticks were cut short by the clock then, and now again."""

    ticks: int
    frames: int
    cut: int
    differences: tuple[Difference, ...]

    @property
    def identical(self) -> bool:
        """Whether every frame is the log's, bit by bit."""
        return not self.differences


def replay(
    path: Annotated[Path, argument("LOG", "A log of the controller, its record beside it.")],
    *,
    json_output: Json = False,
    effects: OwnEffects,
    controllers: OwnControllers,
) -> int:
    """Run the controller of a log again; 0 where all frames of a whole log are the same, else 1."""
    if path.suffix.lower() != ".blf":
        raise ValueError(
            f"{path}: log must be the .blf file that a run wrote: other formats keep neither times to the ns nor the"
            " notes that a replay needs"
        )
    known = models.effects.Catalogue.read(effects)
    record, catalogue = read_log_record(path), load_catalogue()
    held = 0

    def counted() -> Iterator[Logged]:
        nonlocal held
        for frame in read_frames(path, lambda said: note(f"{path}: {said}")):
            held += 1
            yield frame

    try:
        _fits(record, catalogue)
        with output_to_notes():
            task = task_of(record, str(path), known)
            found = replayed(counted(), task, catalogue, record.get("dry_run", False))
    except ValueError as error:
        raise ValueError(str(error) if str(error).startswith(str(path)) else f"{record_path(path)}: {error}") from None
    if not found.ticks:
        raise ValueError(
            f"{path}: log must hold ticks that its controller led through, each begun by a SYNC that it sent; got none:"
            " an empty log, or a recording of what another node heard"
        )
    cut_off = _cut_off(held, record.get("entries"))
    _say(path, found, catalogue, cut_off, (str(record.get("code", "unknown")), code_version()), json_output)
    return 0 if found.identical and not cut_off else 1


def _cut_off(held: int, entries: int | None) -> str:
    """Why a log that holds so many frames and notes is not the whole log of its run, "" where it is."""
    if entries is None:
        return "its record does not say where the log ends: its run was killed, goes on, or was an earlier version's"
    return "" if held == entries else f"the log is cut off or another one: {held} of {entries} frames and notes"


def _say(
    path: Path, found: Replay, catalogue: FrameCatalogue, cut_off: str, code: tuple[str, str], json_output: bool
) -> None:
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
    same = f"as logged, as far as they go; {cut_off}" if cut_off else "identical"
    differs = f"{len(found.differences)} ticks differ" + (f"; {cut_off}" if cut_off else "")
    if not found.identical and code[0] != code[1]:
        lines = [*lines, f"code: log {code[0]}, now {code[1]}"]
    said = same if found.identical else differs
    answer(json_output, document, f"{found.ticks} ticks, {found.frames} frames: {said}", *lines)


def _fits(record: Mapping[str, Any], catalogue: FrameCatalogue) -> None:
    """Raises ValueError for a record of another format, and for frames of another DBC."""
    for key, own in (("format", FORMAT), ("catalogue", catalogue.fingerprint)):
        if record.get(key) != own:
            raise ValueError(f"{key} must be {own}, as this program has it; got {shown(record.get(key))}")


def replayed(frames: Iterable[Logged], task: Task, catalogue: FrameCatalogue, dry_run: bool = False) -> Replay:
    """The controller of `task` on the `frames` of a log; of a last tick cut off the begin is compared."""
    tape = Tape()
    sent: list[tuple[int, bytes]] = tape.sent

    def keep(message: can.Message) -> None:
        if dry_run and not message.is_rx:
            sent.append((message.arbitration_id, bytes(message.data)))

    with tape:
        node = ControllerNode(task, tape, observer=keep, dry_run=dry_run)
        return _compared(node, tape, list(ticks_of(frames, catalogue["Sync"].id)))


def _compared(node: ControllerNode, tape: Tape, events: list[TickOfLog | Word]) -> Replay:
    sent = tape.sent
    ticks = count = cut = 0
    differences: list[Difference] = []
    last = next((k for k in range(len(events) - 1, -1, -1) if isinstance(events[k], TickOfLog)), -1)
    for k, event in enumerate(events):
        if isinstance(event, Word):
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


def ticks_of(frames: Iterable[Logged], sync: int) -> Iterator[TickOfLog | Word]:
    """Ticks and operator's words of a log in order; a tick heard what stands before its SYNC, back to the one before,
    and what a note says. Raises ValueError where frames are missing.
    """
    tick: TickOfLog | None = None
    exact: float | None = None
    solved, heard_before = True, False
    waiting: list[can.Message] = []
    for logged in frames:
        if logged.way == NOTED and logged.id in (EXACT, UNSOLVED, HEARD, LOST, CUT):
            value = struct.unpack("<d", logged.data)[0]
            if logged.id == LOST:
                raise ValueError(f"log must be whole to be replayed; frames are missing at {logged.time_s:g} s")
            exact = value if logged.id == EXACT else exact
            solved, heard_before = solved and logged.id != UNSOLVED, heard_before or logged.id == HEARD
            if logged.id == CUT and tick is not None and math.isfinite(value):
                tick.cut_after = int(value)
            continue
        time_s, exact = logged.time_s if exact is None else exact, None
        if logged.way == NOTED:
            if tick is not None:
                yield tick
            tick = None
            yield Word(logged.id, time_s, struct.unpack("<d", logged.data)[0])
        elif logged.way == RECEIVED:
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
