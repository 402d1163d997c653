"""What `capsule run RIG.toml check` looks at before anything moves: bus, drive, limits, model, time."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import can

from controller.limits import Limits
from hil.app.run import machine
from hil.app.run.clock import ClockedBus, Histogram
from hil.app.run.replay import Tape
from hil.app.scenario.deployment import Deployment
from hil.bus.authenticated import AuthenticatedBus
from hil.bus.catalogue import load_catalogue
from hil.bus.codec import NOT_MEASURED_C
from hil.bus.protection import Sender
from hil.nodes.frame_map import ENABLE, ENABLED, FAULT, WAITING, frame_map_of, heartbeat
from hil.nodes.node import ControllerNode, Task
from hil.nodes.receive import FrameReceiver

LISTEN_S: Final = 0.5  # to the bus
REHEARSED: Final = 400  # ticks
SHARE: Final = 0.5  # of a tick that its work may take
_STATES: Final = ("boot", "self test", "standby", "ready", "enabled", "derated", "quick stop", "fault")


@dataclass(frozen=True)
class Point:
    """One thing that was looked at."""

    what: str
    good: bool
    words: str


def check(deployment: Deployment, task: Task, bus: ClockedBus) -> list[Point]:
    """All points. Nothing is sent: sensors that sample at SYNC alone are heard only while something else sends it."""
    return [
        *_listen(deployment, bus),
        *_authentication(bus),
        limits_point(deployment.limits, deployment.rig.kind),
        _model(deployment),
        _time(task),
        _machine(deployment, bus),
    ]


def _listen(deployment: Deployment, bus: ClockedBus) -> list[Point]:
    clock, began = bus.clock, bus.clock.now()
    receiver = FrameReceiver(bus, frame_map_of(deployment.rig.kind), deployment.control.tick_s)
    while clock.now() - began < LISTEN_S:
        receiver.listen(clock.now())
        time.sleep(0.002)
    got = {r.frame.name: r for r in receiver.reception.receivers.values()}
    good, refused = sum(s.accepted for s in got.values()), sum(s.refused.total() for s in got.values())
    others = receiver.reception.unknown.total()
    words = f"{good} good frames, {refused} refused, {others} of others in {LISTEN_S:g} s{receiver.error_words}"
    told = [said for said in (receiver.refused_words, receiver.other_controller) if said]
    sound = good > 0 and not refused and not receiver.errors and not receiver.deaf and not receiver.foreign
    heard = Point("bus", sound, "; ".join([words, *told]))
    doubt = receiver.doubt(clock.now())
    frame_map, state = frame_map_of(deployment.rig.kind), receiver.state
    fed = got[frame_map.feedback].accepted > 0
    doubt = doubt or ("" if receiver.beating or not fed else "no heartbeat as capsule.dbc has it")
    warm = "" if receiver.temperature_C == NOT_MEASURED_C else f", {receiver.temperature_C:g} degC"
    words = doubt or (f"{_STATES[state]}{warm}" if fed else "nothing heard")
    drive = Point(f"drive {frame_map.node}", not doubt and fed and state != FAULT, words)
    age = receiver.evidence(clock.now()).localisation_s
    seen = f"newest {1e3 * age:.0f} ms old" if math.isfinite(age) else "nothing heard"
    return [heard, drive, Point("localisation", age <= deployment.limits.age_s, seen)]


def limits_point(limits: Limits, kind: str) -> Point:
    """Every limit must fit into its signal: beyond it the codec would refuse the command."""
    frame_map = frame_map_of(kind)
    frame = load_catalogue()[frame_map.command]
    for signal, name in frame_map.bounds:
        field, most = frame.field(signal), float(getattr(limits, name))
        if most > field.upper:
            return Point(
                "limits", False, f"{name} must be at most {field.upper:g} of {frame.name} {signal}; got {most:g}"
            )
    return Point("limits", True, f"within {frame.name}")


def _authentication(bus: ClockedBus) -> list[Point]:
    """Whether what was heard is genuine, on a bus with a key."""
    if not isinstance(bus.inner, AuthenticatedBus):
        return []
    refused = bus.inner.refused
    told = ", ".join(f"{count} {reason}" for reason, count in sorted(refused.items()))
    return [Point("authentication", not refused, f"frames without it: {told or 'none'}")]


def _model(deployment: Deployment) -> Point:
    if deployment.verdict is None:
        return Point("model", True, "nominal values of the rig file")
    return Point("model", deployment.verdict.passed, deployment.verdict.sentence)


def _time(task: Task) -> Point:
    took = rehearse(task)
    p99 = took.quantile(0.99)
    words = f"p99 {1e3 * p99:.2f} ms, max {1e3 * took.longest_s:.2f} ms of a tick of {1e3 * task.model.tick_s:g} ms"
    late = machine.lateness()
    held = machine.tick_to_hold(late, p99, SHARE)
    holds = f"a tick of {1e3 * held:g} ms" if math.isfinite(held) else "no tick"
    words += f"; woken late by {1e3 * late.quantile(0.99):.2f} ms (p99), {1e3 * late.longest_s:.2f} (longest) at the"
    words += f" present priority: this machine holds {holds} (control.tick_s)"
    return Point("time", p99 <= SHARE * task.model.tick_s, words)


def _machine(deployment: Deployment, bus: ClockedBus) -> Point:
    """What the interface and the machine lack; another bit rate than the file's is bad, the rest is advice."""
    table, link = deployment.bus, machine.link_of(deployment.bus)
    faults, priority = machine.link_faults(link, table), machine.priority_words(deployment.control)
    told = [*faults, *machine.link_advice(link, table), *([priority] if priority else [])]
    told.append(f"time stamps: {machine.stamp_words(table, bus)}")
    return Point("machine", not faults, "; ".join(told))


def rehearse(task: Task, ticks: int = REHEARSED) -> Histogram:
    """How long a tick takes on a made-up drive that obeys; the first half only warms up."""
    took = Histogram()
    with Tape() as tape:
        node = ControllerNode(replace(task, probe=False), tape, dry_run=True)
        speak = _made_up(node, tape)
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


def _made_up(node: ControllerNode, tape: Tape) -> Callable[[int, float], None]:
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
            place = 1e-5 * ((k // every) % 3 - 1)
            say("CapsuleLocalisation", {"Position_m": place, "Quality": 1.0, "Age_s": 0.002, "Valid": 1}, now)
        if k % max(round(0.02 / node.tick_s), 1) == 0:
            say(frame_map.heartbeat, heartbeat(2, now), now)

    return speak
