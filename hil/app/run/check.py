"""The bus of a deployment, opened and heard; `capsule run RIG.toml check`: all of it before anything moves."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import can

from controller.limits import Limits
from hil.app.console import note
from hil.app.run import machine
from hil.app.run.clock import ClockedBus, Histogram
from hil.app.run.machine import TEXT, open_bus
from hil.app.run.replay import Tape
from hil.app.scenario.deployment import Deployment
from hil.bus.authenticated import AuthenticatedBus
from hil.bus.catalogue import load_catalogue
from hil.bus.codec import NOT_MEASURED_C
from hil.bus.local import LocalBus
from hil.bus.protection import Sender
from hil.bus.wrapping import heard_for, plain
from hil.drives.carriage_bus import CarriageBus
from hil.drives.makers import MAKERS
from hil.nodes.frame_map import ENABLE, ENABLED, FAULT, WAITING, controllers_frames, frame_map_of, heartbeat
from hil.nodes.node import ControllerNode
from hil.nodes.receive import FrameReceiver, operators_stop, remedy
from hil.nodes.task import Task

LISTEN_S: Final = 0.5  # to the bus
REHEARSED: Final = 400  # ticks
MISSED: Final = 0.05  # share of frames refused by their counters after a pause, through which a run rides
SHARE: Final = 0.5  # of a tick; with more work little is left for a busier moment


@dataclass(frozen=True)
class Point:
    what: str
    good: bool
    words: str

    def document(self) -> dict[str, object]:
        return vars(self) | {"remedy": "" if self.good else remedy(f"{self.what}: {self.words}")}

    @property
    def line(self) -> str:
        said = filter(None, (self.words, str(self.document()["remedy"])))
        return f"{'ok ' if self.good else 'BAD'} {self.what}: {'; '.join(said)}"


def check(deployment: Deployment, task: Task, bus: ClockedBus) -> list[Point]:
    """All points. Nothing is sent, so a sensor that samples at SYNC is heard only while something else sends SYNC."""
    verdict, limits = deployment.verdict, limits_point(deployment.limits, deployment.rig.kind)
    unjudged = TEXT("check.nominal" if deployment.learned is None else "check.chosen")
    model = Point("model", verdict is None or verdict.passed, verdict.sentence if verdict else unjudged)
    heard = _listen(deployment, bus)
    if isinstance(bus.inner, AuthenticatedBus):
        refused = bus.inner.refused
        counts = [f"{count} {reason}" for reason, count in sorted(refused.items())]
        heard.append(Point("authentication", not refused, TEXT("check.authentication", counts=counts or ["none"])))
    # what interface and machine lack: another bit rate than the file's is bad, the rest is advice
    table, link = deployment.bus, machine.link_of(deployment.bus)
    faults, timely = machine.link_faults(link, table), _time(deployment, task)
    advice = (*machine.link_advice(link, table), machine.priority_words(deployment.control))
    said = filter(None, (*faults, *advice, machine.stamp_words(table, bus)))
    return [*heard, limits, model, timely, Point("machine", not faults, "; ".join(said))]


def _listen(deployment: Deployment, bus: ClockedBus) -> list[Point]:
    clock, began, frame_map = bus.clock, bus.clock.now(), frame_map_of(deployment.rig.kind)
    receiver = FrameReceiver(bus, frame_map, deployment.control.tick_s)
    while clock.now() - began < LISTEN_S:
        receiver.listen(clock.now())
        time.sleep(0.002)
    got = {r.frame.name: r for r in receiver.reception.receivers.values()}
    good, refused = sum(s.accepted for s in got.values()), sum(s.refused.total() for s in got.values())
    missed = sum(s.refused["counter"] for s in got.values())
    counts = {"good": good, "refused": refused, "others": receiver.reception.unknown.total(), "seconds": LISTEN_S}
    said = [TEXT("check.bus", **counts) + receiver.error_words, receiver.refused_words, receiver.other_controller]
    few = refused == missed <= MISSED * good
    sound = good > 0 and few and not receiver.errors and not receiver.deaf and not receiver.foreign
    heard = Point("bus", sound, "; ".join(filter(None, said)))
    doubt, fed = receiver.doubt(clock.now()), got[frame_map.feedback].accepted > 0
    doubt = doubt or ("" if receiver.beating or not fed else TEXT("check.no_heartbeat"))
    warm = "" if receiver.temperature_C == NOT_MEASURED_C else f", {receiver.temperature_C:g} degC"
    state = frame_map.state_name(receiver.state).replace("_", " ") + warm if fed else TEXT("check.silent")
    drive = Point(f"drive {frame_map.node}", not doubt and fed and receiver.state != FAULT, doubt or state)
    age = receiver.evidence(clock.now()).localisation_s
    seen = TEXT("check.localisation", ms=1e3 * age) if math.isfinite(age) else TEXT("check.silent")
    return [heard, drive, Point("localisation", age <= deployment.limits.age_s, seen)]


def limits_point(limits: Limits, kind: str) -> Point:
    """Every limit must fit into its signal: beyond it the codec would refuse the command."""
    frame_map = frame_map_of(kind)
    frame = load_catalogue()[frame_map.command]
    for signal, name in frame_map.bounds:
        most, upper = float(getattr(limits, name)), frame.field(signal).upper
        if most > upper:
            return Point("limits", False, f"{name} must be at most {upper:g} of {frame.name} {signal}; got {most:g}")
    return Point("limits", True, TEXT("check.limits", frame=frame.name))


def _time(deployment: Deployment, task: Task) -> Point:
    """Whether 99 of 100 ticks are done before the next one, at the priority of a run, which then keeps its grid."""
    with machine.as_a_run(deployment.control.priority, deployment.control.core):
        took, late, tick_s = rehearse(task), machine.lateness(), task.model.tick_s
    p99, late_p99 = took.quantile(0.99), late.quantile(0.99)
    good, shortest = p99 + late_p99 <= tick_s, machine.tick_to_hold(late, p99, SHARE)
    said = TEXT("check.time", p99=1e3 * p99, longest=1e3 * took.longest_s, tick=1e3 * tick_s)
    said += TEXT("check.late", p99=1e3 * late_p99, longest=1e3 * late.longest_s)
    if not good:
        said += TEXT("check.missed")
    if p99 > SHARE * tick_s:
        said += TEXT("check.tick", tick=1e3 * shortest) if math.isfinite(shortest) else TEXT("check.no_tick")
    return Point("time", good, said)


def rehearse(task: Task, ticks: int = REHEARSED) -> Histogram:
    """How long a tick takes with a simulated drive that follows at once; the first half only warms up."""
    took = Histogram()
    with Tape() as tape:
        node = ControllerNode(replace(task, probe=False), tape, dry_run=True)
        speak = _simulated(node, tape)
        tick_s = task.model.tick_s
        for k in range(ticks):
            now = round(k * tick_s, 9)
            speak(k, now)
            if k == ticks // 8:
                node.start(now)
            began = time.perf_counter()
            node.tick(now)
            if k >= ticks // 2:
                took.add(time.perf_counter() - began)
    return took


def _simulated(node: ControllerNode, tape: Tape) -> Callable[[int, float], None]:
    """Frames of a drive that follows at once and of a localisation every 10 ms around 0."""
    frame_map, catalogue = node.frame_map, load_catalogue()
    names = (frame_map.feedback, frame_map.heartbeat, "CapsuleLocalisation")
    senders = {name: Sender(catalogue[name]) for name in names}
    rest = {field.name: 0.0 for field in catalogue[frame_map.feedback].fields}

    def say(name: str, values: dict[str, float], now: float) -> None:
        tape.inbox.append(can.Message(now, catalogue[name].id, False, data=senders[name].frame(values), is_rx=True))

    def speak(k: int, now: float) -> None:
        state = ENABLED if node.guard.sent.mode == ENABLE else WAITING
        moved = {} if frame_map.drive.shaken else {frame_map.signal: node.guard.sent.value}
        say(frame_map.feedback, rest | moved | {"State": state, "Temperature_degC": 25.0}, now)
        every = max(round(0.01 / node.tick_s), 1)
        if k % every == 0:
            position_m = 1e-5 * ((k // every) % 3 - 1)
            say("CapsuleLocalisation", {"Position_m": position_m, "Quality": 1.0, "Age_s": 0.002, "Valid": 1}, now)
        if k % max(round(0.02 / node.tick_s), 1) == 0:
            say(frame_map.heartbeat, heartbeat(2, now), now)

    return speak


QUIET_S: Final = 0.1  # How long to listen before anything is sent: five cycles of a controller's slowest frame


def drives_bus(deployment: Deployment, folder: Path, listen_only: bool, faulty: bool) -> can.BusABC:
    """The deployment's bus; another maker's drive is set up, unless nothing may be sent. Raises ValueError, and an
    OtherControllerError where another controller is heard.
    """
    bus, table = open_bus(deployment.bus, folder), deployment.drive
    if not listen_only:
        known, heard = controllers_frames(), set[str]()
        for message in heard_for(bus, QUIET_S):
            if plain(message) and message.arbitration_id in known and not operators_stop(message):
                heard.add(known[message.arbitration_id])
            elif table is not None and table.orders(message):
                heard.add("commands to the drive")
        if heard:
            bus.shutdown()
            raise OtherControllerError(TEXT("end.other_controller", frames=", ".join(sorted(heard))))
    if table is None:
        return bus
    if not listen_only:
        try:
            limits, tick_s = deployment.limits, deployment.control.tick_s
            for sentence in MAKERS[table.where].set_up(bus, table, limits, tick_s, faulty=faulty):
                note(sentence)
        except ValueError:
            bus.shutdown()
            raise
    return MAKERS[table.where].bus(bus, table, deployment.control.tick_s)


class OtherControllerError(Exception):
    """Another controller has been heard before anything was sent."""


def overruns(bus: can.BusABC) -> int:
    """Frames for which there was no room in another node's queue, as the local bus counts them."""
    while isinstance(bus, ClockedBus | CarriageBus | AuthenticatedBus):
        bus = bus.inner
    return bus.overruns if isinstance(bus, LocalBus) else 0
