"""`capsule run`: the controller alone, on a real actuator bus."""

import logging
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

import can
import typer

from controller.supervision.fallback import shares
from hil.app.console import answer, note, output_to_notes
from hil.app.ends import RUN_ENDS
from hil.app.learn.background import Background
from hil.app.learn.learner import Learner, Lesson, check_learnt
from hil.app.run.check import Point, check, limits_point, rehearse
from hil.app.run.clock import Clock, ClockedBus
from hil.app.run.loop import Outcome, StopSignals, lead, reset
from hil.app.run.machine import prepare_process
from hil.app.scenario.deployment import BusTable, Deployment, load_deployment
from hil.app.scenario.model_use import health_of, health_words, offer_words, told
from hil.app.shared_options import (
    Json,
    Learn,
    McapFile,
    OwnControllers,
    OwnEffects,
    ReferenceFile,
    argument,
    option,
)
from hil.app.write import check_file, check_mcap, check_targets
from hil.bus.authenticated import AuthenticatedBus, authenticator
from hil.bus.catalogue import load_catalogue
from hil.bus.key import next_epoch, read_key
from hil.bus.local import LocalBus
from hil.drives.carriage_bus import CarriageBus
from hil.drives.makers import carriage_bus, set_up
from hil.drives.table import ActuatorTable
from hil.log.log import FrameLog
from hil.log.place import record_path
from hil.log.recorder import Recorder, log_record
from hil.nodes.controller.node import ControllerNode, Task
from hil.nodes.frame_map import controllers_frames, plain
from hil.nodes.listening import heard_for
from models.effects import Catalogue
from models.files.toml import in_file
from models.parameter import nearest

ACTIONS = ("lead", "check", "reset")
QUIET_S: Final = 0.1
"""How long to listen before anything is sent: five cycles of a controller's slowest frame."""
PROBED_S: Final = 0.05
"""How long a check leads after its probe, at rest."""
_TURN_S: Final = 1e-4  # of Python's switch interval
TIMED: Final = ("pcan", "kvaser", "vector")
"""Interfaces whose CAN FD bit timing python-can sets."""
_DRIVERS = logging.getLogger("can")
"""What drivers say beside their errors; the errors alone are told."""


def run(
    path: Annotated[Path, argument("RIG.toml", "A rig file with [bus], [control], [reference] and [limits].")],
    *,
    action: Annotated[
        str, argument("check|reset", "check: look at all, send nothing; reset: acknowledge a latched fault, no more.")
    ] = "lead",
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Listen and compute, send nothing.")] = False,
    log: Annotated[Path | None, option("--log", "LOG.blf", "Where the log goes; else beside you.")] = None,
    mcap: McapFile = None,
    reference: ReferenceFile = None,
    json_output: Json = False,
    effects: OwnEffects,
    controllers: OwnControllers,
    learn: Learn = False,
    move: Annotated[
        bool, typer.Option("--move", help="With check: lead the drive by 5 mm to and fro, and see the capsule answer.")
    ] = False,
) -> int:
    """Lead, check or reset the drive: 0 where it went as asked, else 1 (`RUN_ENDS`). Raises ValueError."""
    if action not in ACTIONS:
        raise ValueError(f"action must be one of {', '.join(ACTIONS)}; got {action!r}; {nearest(action, ACTIONS)}")
    deployment = load_deployment(path, reference, Catalogue.read(effects))
    log = log or Path(f"{deployment.name}.blf")
    if move and (action != "check" or dry_run):
        raise ValueError("--move must go with check; got it with leading, reset or --dry-run")
    if action != "check" or move:
        check_targets([check_file(log, "--log", (".blf",)), record_path(log)], "--log", [path])
    if learn:
        check_learnt(deployment.rig)
        if action != "lead" or dry_run:
            raise ValueError("--learn must go with leading; got it with check, reset or --dry-run")
    if mcap is not None:
        check_mcap(mcap, [path, log])
    verdict = deployment.verdict
    if action == "reset" and dry_run:
        raise ValueError("--dry-run must go with leading; got 'reset', which does nothing but send")
    if action == "lead" and verdict is not None and not verdict.passed and not dry_run:
        raise ValueError(f"{path}: model must pass the gate before it leads; got: {verdict.sentence}")
    limits = limits_point(deployment.limits, deployment.rig.kind)
    if action != "check" and not limits.good:
        raise ValueError(f"{path}: {limits.words}")
    asked = _Asked(path, deployment, action, dry_run, log, mcap, learn)
    try:
        if action == "check":
            return _checked(asked, move, json_output)
        return _led(asked, json_output)
    except _OtherControllerError as error:
        return _not_begun(path, str(error), json_output)


@dataclass(frozen=True)
class _Asked:
    """What `run` is asked for that can be used."""

    path: Path
    deployment: Deployment
    action: str
    dry_run: bool
    log: Path
    mcap: Path | None = None
    learn: bool = False

    @contextmanager
    def begun(self) -> Iterator[tuple[Task, ClockedBus]]:
        """The task and its bus; what is printed meanwhile are notes. Raises ValueError, _OtherControllerError."""
        listens, resets = self.dry_run or self.action == "check", self.action == "reset"
        with output_to_notes():
            task = self.deployment.task()
            with in_file(self.path):
                bus = ClockedBus(_drives_bus(self.deployment, self.path.parent, listens, resets), Clock())
            with bus:
                yield task, bus


def _checked(asked: _Asked, move: bool, json_output: bool) -> int:
    """Look, move the drive where that is asked for, and say what was found."""
    with asked.begun() as (task, bus):
        points = check(asked.deployment, task, bus)
    if move:
        points.append(_moved(asked, all(p.good for p in points)))
    good = all(p.good for p in points)
    lines = (f"{'ok ' if point.good else 'BAD'} {point.what}: {point.words}" for point in points)
    answer(json_output, {"rig": str(asked.path), "good": good, "points": [vars(p) for p in points]}, *lines)
    return 0 if good else 1


def _led(asked: _Asked, json_output: bool) -> int:
    """Lead, or reset, and say what came of it. Raises _OtherControllerError where nothing was sent."""
    with asked.begun() as (task, bus):
        outcome, node, frames_log, lessons = _lead(asked, task, bus)
        if RUN_ENDS[outcome.end].status and isinstance(bus.inner, CarriageBus) and bus.inner.trouble:
            outcome.ended += f"; {bus.inner.trouble}"
    found = _document(asked, outcome, node, frames_log) | {"overruns": _overruns(bus)}
    found |= told(asked.deployment.offered, node.estimator.taken_at)
    if isinstance(bus.inner, AuthenticatedBus):
        found["unauthenticated"] = dict(bus.inner.refused)
    if asked.learn:
        found["learned"] = [lesson.document() for lesson in lessons]
    if node.operator is not None:
        found["operator"] = node.operator.document()
    found["monitor"] = health_of(node.estimator.health, node.estimator.origin_s)
    answer(json_output, found, *_lines(found, lessons))
    return RUN_ENDS[str(found["end"])].status


def _moved(asked: _Asked, good: bool) -> Point:
    """Whether the capsule answers the drive: the probe alone, led on the bus, where all else is `good`."""
    if not good:
        return Point("answer", False, "the drive was not moved, as something else is bad")
    short = replace(asked.deployment, control=asked.deployment.control.but(duration_s=PROBED_S, probe=True))
    probing = replace(asked, deployment=short, action="lead", mcap=None)
    with probing.begun() as (task, bus):
        outcome = _lead(probing, task, bus)[0]
    done = outcome.end == "done"
    return Point("answer", done, "the capsule went to and fro as asked" if done else outcome.ended)


def _not_begun(path: Path, words: str, json_output: bool) -> int:
    """Say that there is another controller; nothing was sent."""
    ended = f"nothing to lead: {words}"
    found = {"rig": str(path), "end": "other_controller", "ended": ended, "led": False, "ticks": 0, "log": None}
    answer(json_output, found, f"ended: {ended}")
    return RUN_ENDS["other_controller"].status


def open_bus(table: BusTable, folder: Path = Path()) -> can.BusABC:
    """The bus of a file in `folder`, authenticated where it names a key. Raises ValueError of one sentence."""
    if not table.key_file:
        return _plain_bus(table)
    key_file = folder / table.key_file
    key = read_key(key_file)
    authenticator(key)
    inner = _plain_bus(table)
    try:
        return AuthenticatedBus(inner, key, next_epoch(key_file))
    except ValueError:
        inner.shutdown()
        raise


def _plain_bus(table: BusTable) -> can.BusABC:
    if not _DRIVERS.handlers:
        _DRIVERS.addHandler(logging.NullHandler())
    if table.interface not in can.VALID_INTERFACES:
        known = sorted(can.VALID_INTERFACES)
        raise ValueError(
            f"bus.interface must be one of {', '.join(known)}; got {table.interface!r};"
            f" {nearest(table.interface, known)}"
        )
    try:
        return can.Bus(
            interface=table.interface, channel=None if table.channel == "" else table.channel, **_rate(table)
        )
    except Exception as error:  # noqa: BLE001 - drivers of many makers raise whatever they like
        words = " ".join(str(error).split())[:200] or type(error).__name__
        up = (
            f"; 'ip link set {table.channel} up type can bitrate {table.bitrate}{_fd_words(table)}' brings it up, in a"
            " kernel that knows CAN"
        )
        remedy = up if table.interface == "socketcan" and table.channel != "" else ""
        raise ValueError(
            f"bus must be one that opens; got {table.interface} {table.channel!r}: {words}{remedy}"
        ) from None


def _rate(table: BusTable) -> dict[str, Any]:
    """How python-can is told the bit rate: makers' adapters take a CAN FD timing, SocketCAN's is the kernel's."""
    if not table.fd:
        return {"bitrate": table.bitrate}
    if table.interface in TIMED:
        return {"fd": True, "timing": table.timing()}
    if table.interface == "socketcan":
        mtu = Path(f"/sys/class/net/{table.channel}/mtu")
        if mtu.is_file() and mtu.read_text(encoding="ascii").strip() == "16":
            raise can.CanInitializationError("the interface is up for classic CAN alone")
    return {"fd": True, "bitrate": table.bitrate, "data_bitrate": table.data_bitrate}


def _fd_words(table: BusTable) -> str:
    points = f" sample-point {table.sample_point:g} dsample-point {table.data_sample_point:g}"
    return f"{points} dbitrate {table.data_bitrate} fd on" if table.fd else ""


def _drives_bus(deployment: Deployment, folder: Path, listen_only: bool, faulty: bool) -> can.BusABC:
    """The deployment's bus; another maker's drive on it is set up, but where nothing may be sent. Raises ValueError."""
    bus, table = open_bus(deployment.bus, folder), deployment.drive
    if not listen_only and (others := _controllers_on(bus, table)):
        bus.shutdown()
        raise _OtherControllerError(f"another controller is on the bus ({', '.join(others)})")
    if table is None:
        return bus
    if not listen_only:
        try:
            for sentence in set_up(bus, table, deployment.limits, deployment.control.tick_s, faulty=faulty):
                note(sentence)
        except ValueError:
            bus.shutdown()
            raise
    return carriage_bus(bus, table, deployment.control.tick_s)


class _OtherControllerError(Exception):
    """Another controller has been heard before anything was sent."""


def _controllers_on(bus: can.BusABC, table: ActuatorTable | None) -> list[str]:
    """What only a controller sends, heard within `QUIET_S`, by name: this one listens before it speaks."""
    known, heard = controllers_frames(), set[str]()
    for message in heard_for(bus, QUIET_S):
        if plain(message) and message.arbitration_id in known:
            heard.add(known[message.arbitration_id])
        elif table is not None and table.orders(message):
            heard.add("commands to the drive")
    return sorted(heard)


def _lead(asked: _Asked, task: Task, bus: ClockedBus) -> tuple[Outcome, ControllerNode, FrameLog, list[Lesson]]:
    deployment, path, dry_run = asked.deployment, asked.log, asked.dry_run
    catalogue, control = load_catalogue(), deployment.control
    record = log_record(
        {"deployment": deployment.text},
        control.controller,
        deployment.values,
        deployment.limits,
        catalogue,
        dry_run=dry_run,
        bus=vars(deployment.bus),
        offered=deployment.offered and deployment.offered.document(),
        clock_origin_ns=bus.clock.origin_ns,
    )
    rehearse(task)
    with (
        FrameLog(path, record, note, asked.mcap) as frames_log,
        StopSignals().caught() as signals,
        ExitStack() as beside,
    ):
        if frames_log.kept is not None:
            note(f"older log kept as {frames_log.kept}")
        if frames_log.path != path:
            note(f"{path} is the log of a run that goes on: this one's is {frames_log.path}")
        recorder = Recorder(frames_log, dry_run)
        node = ControllerNode(task, bus, observer=recorder, dry_run=dry_run)
        learner = beside.enter_context(_learning(deployment, node, frames_log)) if asked.learn else None
        refused = prepare_process(control.priority, control.core)
        if control.priority > 0 and not refused:
            frames_log.hasten(1)
        for sentence in refused:
            note(sentence)
        if asked.action == "reset":
            outcome = reset(node, bus.clock, recorder, signals)
        else:
            note(f"{deployment.name}: leading for {control.duration_s:g} s; Ctrl-C stops")
            outcome = lead(node, bus.clock, control.duration_s, recorder, signals, control.give_up_s, learner)
    return outcome, node, frames_log, [] if learner is None else learner.lessons


@contextmanager
def _learning(deployment: Deployment, node: ControllerNode, frames_log: FrameLog) -> Iterator[Learner]:
    """What learns from a run: a process that identifies, and a thread that makes controllers and writes the record,
    both there before the first tick.
    """
    maker, turn_s = ThreadPoolExecutor(1), sys.getswitchinterval()

    def keep(record: Mapping[str, Any]) -> None:
        maker.submit(frames_log.add_to_record, record)

    with maker, Background() as background:
        background.begin()
        maker.submit(int).result()
        sys.setswitchinterval(_TURN_S)
        try:
            yield Learner(
                node.estimator,
                deployment.rig,
                deployment.values,
                deployment.believed,
                background,
                deployment.pace.model_copy(update={"answer_s": math.inf}),
                maker.submit,
                keep,
                node.drive,
            )
        finally:
            sys.setswitchinterval(turn_s)


def _document(asked: _Asked, outcome: Outcome, node: ControllerNode, frames_log: FrameLog) -> dict[str, Any]:
    grid, missing = outcome.grid, frames_log.dropped + frames_log.lost
    whole = not missing and not frames_log.troubles
    not_kept = [] if whole or RUN_ENDS[outcome.end].status else frames_log.troubles[-1:]
    return {
        "rig": str(asked.path),
        "controller": node.task.controller,
        "dry_run": asked.dry_run,
        "end": outcome.end if whole or RUN_ENDS[outcome.end].status else "log",
        "ended": "; ".join([outcome.ended, *not_kept]),
        "led": outcome.led,
        "led_share": shares(node.answer.led),
        "jumps": {"count": node.answer.jumps, "last_m": node.answer.jump_m},
        "ticks": grid.ticks,
        "missed_ticks": grid.missed,
        "cut_ticks": outcome.cut,
        "late_ms": grid.late.document(),
        "tick_ms": outcome.busy.document(),
        "rejected": node.receiver.rejected,
        "refused_frames": node.receiver.refused,
        "other_types": dict(node.receiver.strange),
        "other_controller": dict(node.receiver.foreign),
        "deaf_ticks": node.receiver.deaf,
        "full_ticks": node.receiver.full,
        "refused": sum(node.guard.refused.values()),
        "unsent": node.guard.unsent,
        "log": str(frames_log.path),
        "log_dropped": missing,
        "log_troubles": frames_log.troubles,
    }


def _overruns(bus: can.BusABC) -> int:
    """Frames for which there was no room in another node's queue, as the local bus counts them."""
    while isinstance(bus, ClockedBus | CarriageBus | AuthenticatedBus):
        bus = bus.inner
    return bus.overruns if isinstance(bus, LocalBus) else 0


def _lines(found: dict[str, Any], lessons: Sequence[Lesson]) -> Iterator[str]:
    yield f"{found['controller']}: {found['ticks']} ticks, {found['missed_ticks']} missed; ended: {found['ended']}"
    yield from found["log_troubles"]
    for name, words in (("late_ms", "began late by"), ("tick_ms", "took")):
        times = found[name]
        yield f"ticks {words} ms: median {times['median']:.3f}, p99 {times['p99']:.3f}, max {times['max']:.3f}"
    if found["cut_ticks"]:
        yield f"{found['cut_ticks']} plans were cut short by the clock"
    yield from filter(None, (health_words(found), offer_words(found), *(lesson.words for lesson in lessons)))
    yield f"log: {found['log']}"
