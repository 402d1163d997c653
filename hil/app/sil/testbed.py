"""Controller and plant as nodes on one simulated bus; time moves on once every node has done its slot."""

import math
import random
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import can

from controller.model.control_model import ControlModel, control_model
from hil.app.scenario.bus_scenario import SilScenario
from hil.app.sil.senders import FalseController, ScriptedOperator, second_operators
from hil.bus.authenticated import AuthenticatedBus, inside, read_key
from hil.drives.carriage_bus import CarriageBus
from hil.drives.makers import MAKERS
from hil.log.recorder import START, Recorder
from hil.nodes.frame_map import frame_map_of, frames
from hil.nodes.node import ControllerNode, NodeTick
from hil.nodes.operator import SETPOINT
from hil.nodes.task import Task
from hil.simulated.faults import LIES, SETPOINTS, Fault
from hil.simulated.fmu_plant import FmuPlant
from hil.simulated.injection import TAMPERING, FaultInjection
from hil.simulated.medium import Medium, SimulatedBus
from hil.simulated.plant_node import SLOT_S, PlantNode, power_of, simulated_drive
from models.theta import Theta
from plant.session import Session

PHASE_S = 0.2e-3
"""The drives' firmware runs this long after the begin of a tick: SYNC has arrived, the tick's command has not."""
_BABBLE = 0  # identifier that wins every arbitration
_EPOCH = 2  # of every node on an authenticated bus; faults use an earlier one
_ERRORS = 15  # until a receiver is error passive: 8 counts each to 128


def believed_on_bus(scenario: SilScenario, values: Theta) -> ControlModel:
    """The control model that the controller believes in; on the bus a coil is commanded by its current."""
    return control_model(scenario.loop.belief, values, scenario.loop.control.tick_s)


def task_on_bus(scenario: SilScenario, model: ControlModel, controller: str, **more: Any) -> Task:
    loop, seen = scenario.loop, scenario.loop.instruments.localisation
    more |= {"resolution_m": seen.quantum, "estimator": loop.control.estimator, "probe": loop.control.probe}
    return Task(model, controller, loop.reference, loop.limits, seen.std, operator=scenario.operator, **more)


class Bench:
    def __init__(
        self,
        scenario: SilScenario,
        model: ControlModel,
        controller: str,
        seed: int,
        *,
        recorder: Recorder | None = None,
        **more: Any,
    ) -> None:
        """`more` are further fields of the task. Raises ValueError for a controller that cannot lead this rig."""
        self._recorder, self._seed = recorder, seed
        loop, self.scenario = scenario.loop, scenario
        self.tick_s, self.frame_map = loop.control.tick_s, frame_map_of(loop.kind)
        bus = scenario.bus
        fd = bus.fd or (scenario.drive is not None and scenario.drive.fd)
        self.medium = Medium(frames().bit_rate, data_bit_rate=bus.data_bitrate if fd else 0)
        self.ports = {name: SimulatedBus(self.medium, name) for name in ("controller", "drive", "localiser")}
        self._key = read_key(Path(bus.key_file)) if bus.key_file else b""
        self._kinds = {f.kind for f in scenario.faults}
        self._babbler = SimulatedBus(self.medium, "babbler") if "babbling" in self._kinds else None
        self.links: dict[str, FaultInjection] = {}
        self._false = FalseController(self.medium, self.frame_map, self.tick_s, self._kinds)
        ends, drive = {name: self._bus(name, seed + k) for k, name in enumerate(("controller", "drive"))}, None
        plant = None if scenario.plant is None else FmuPlant(Path(scenario.plant.fmu), loop.truth)
        session = Session(loop.truth, replace(loop.instruments, feedback=None), seed, 0.0, plant)
        if scenario.drive is not None:
            _, power = power_of(session, loop.limits)
            drive = simulated_drive(ends["drive"], scenario.drive, power, loop.limits, self.tick_s)
            drive.configure(self.frame_map.life_ms(loop.limits.carriage_speed_m_s))
            ends["controller"] = MAKERS[scenario.drive.where].bus(ends["controller"], scenario.drive, self.tick_s)
        self.carriage = ends["controller"] if isinstance(ends["controller"], CarriageBus) else None
        task = task_on_bus(scenario, model, controller, **more)
        self.node = ControllerNode(task, ends["controller"], observer=recorder)
        self.plant = PlantNode(
            session,
            loop.limits,
            self.tick_s,
            ends["drive"],
            self._authentic(self.ports["localiser"]),
            force_seed=seed if scenario.bus.force_sensor else None,
            drive=drive,
            draw=partial(random.Random(seed).getrandbits, 32),
        )
        self.ends, self.slots = ends, self.plant.slots
        jog = scenario.jog
        self.operator, self.second = None, dict[str, ScriptedOperator]()
        if jog is not None:
            port = self._authentic(SimulatedBus(self.medium, "operator"))
            self.operator = ScriptedOperator(port, jog.source, jog.life_ms, jog.planned(), 0.0)
            if "second_operator" in self._kinds:
                self.second = second_operators(self._authentic(SimulatedBus(self.medium, "second operator")), jog)
        self.ticks = 0
        self._active: list[Fault] = []
        self._due = list(scenario.faults)

    @property
    def time_s(self) -> float:
        return self.ticks * self.tick_s

    @property
    def frames(self) -> int:
        return sum(port.counters.sent for port in self.medium.ports)

    @property
    def rejected(self) -> int:
        return self.node.receiver.rejected + self.plant.drive.rejected

    @property
    def unauthenticated(self) -> Counter[str]:
        refused = (end.refused for end in self.ends.values() if isinstance(end, AuthenticatedBus))
        return sum(refused, Counter())

    @property
    def steered(self) -> tuple[float, float, float, float]:
        """Reference in m, source that steers, how often one began to steer, how often an operator pressed."""
        pressed = sum(one.presses for one in (self.operator, self.second.get("same")) if one is not None)
        operator = self.node.operator
        source, presses = (0, 0) if operator is None else (operator.source, operator.presses)
        return self.node.wanted_m(self.time_s), source, presses, pressed

    def show(self, shown: Callable[[can.Message], None] | None) -> None:
        """Call `shown` with every frame that is sent, as a classic one of the catalogue on an authenticated bus."""
        self.medium.shown = shown if shown is None or not self._key else lambda wire: shown(inside(wire))

    def start(self) -> None:
        """Start the node with the reference at 0; with a probe, where the capsule is after it."""
        here = self.scenario.loop.control.probe
        if self._recorder is not None:
            self._recorder.note(self.time_s, START, math.nan if here else 0.0)
        self.node.start(self.time_s, None if here else 0.0)

    def begin_tick(self) -> NodeTick | None:
        """The controller's part of a tick; None where it is killed or frozen."""
        now = self.time_s
        self._change(now)
        kinds = {fault.kind for fault in self._active}
        if kinds & {"killed", "frozen"}:
            return None
        jump = sum(f.amount for f in self._active if f.kind == "clock_jump")
        solved = "late_solve" not in kinds
        if self._recorder is not None and not solved:
            self._recorder.unsolved(now + jump)
        tick = self.node.tick(now + jump, solved)
        if self._recorder is not None:
            self._recorder.ticked(now + jump, tick.action)
        return tick

    def slot(self, number: int) -> float:
        """The plant's part of a tick's slot `number`; the time at its begin."""
        at = self.time_s + PHASE_S + number * SLOT_S
        self._change(at)
        if number == self.slots - 1:
            self._false.send(at, {fault.kind for fault in self._active})
        if self.operator is not None:
            self.operator.send(at)
        for fault in self._active:
            if self.second and fault.kind == "second_operator":
                self.second[fault.target].send(at)
        if (port := self._babbler) is not None and any(f.kind == "babbling" for f in self._active):
            while len(port.waiting) < 16:
                port.send(can.Message(arbitration_id=_BABBLE, is_extended_id=False, data=bytes(8), is_rx=False))
        self.medium.advance(at)
        self.plant.tick(at)
        return at

    def end_tick(self) -> None:
        self.ticks += 1
        self.medium.advance(self.time_s)

    def _bus(self, name: str, seed: int) -> can.BusABC:
        """The bus of a node: its port, behind a link where a fault tampers with what it receives."""
        if not self._kinds & {*TAMPERING, "unreadable"}:
            return self._authentic(self.ports[name])
        self.links[name] = FaultInjection(self.ports[name], lambda: self.medium.now_s, seed, self._key)
        return self._authentic(self.links[name])

    def _authentic(self, wire: can.BusABC) -> can.BusABC:
        return AuthenticatedBus(wire, self._key, _EPOCH) if self._key else wire

    def _change(self, now: float) -> None:
        """Let the wire run until `now`; faults begin and end at their own times."""
        ends = [(f.end_s, False, f) for f in self._active if f.end_s <= now + 1e-9 and f.kind != "killed"]
        begins = [(f.at_s, True, f) for f in self._due if f.at_s <= now + 1e-9]
        self._due = self._due[len(begins) :]
        ends += [(f.end_s, False, f) for _, _, f in begins if f.end_s <= now + 1e-9 and f.kind != "killed"]
        for at_s, on, fault in sorted([*ends, *begins], key=lambda change: change[0]):
            self.medium.advance(at_s)
            (self._active.append if on else self._active.remove)(fault)
            self._set(fault, on)

    def _set(self, fault: Fault, on: bool) -> None:
        drive = self.plant.drive
        if fault.kind in TAMPERING:
            for link, entry in self._hit(fault):
                link.faults = [*link.faults, entry] if on else [e for e in link.faults if e[0] is not fault]
        elif fault.kind == "unreadable":
            self.links[fault.target].broken = on
        elif fault.kind == "bus_off":
            (self.medium.leave if on else self.medium.recover)(self.ports[fault.target])
        elif fault.kind in ("stuck", "biased", "nan", "lost", *LIES):
            self.plant.spoil(fault, self._seed) if on else self.plant.mend(fault)
        elif fault.kind == "over_temperature":
            drive.heated_to_C = fault.amount if on else -math.inf
        elif fault.kind == "drive_reset" and on:
            drive.boot(self.medium.now_s)
        elif fault.kind == "released" and self.operator is not None:
            self.operator.let_go = True
        elif fault.kind == "encoder_error":
            drive.broken = on
        elif fault.kind == "wrong_node":
            drive.node_id += 1 if on else -1
        elif fault.kind == "wrong_bit_rate":
            self.medium.disturb = _Burst() if on else None
            (self.medium.leave if on else self.medium.recover)(self.ports["drive"])

    def _hit(self, fault: Fault) -> list[tuple[FaultInjection, tuple[Fault, frozenset[int]]]]:
        known, own = frames(), self.frame_map
        commands, reports = frozenset[int](), frozenset[int]()
        if self.scenario.drive is not None:
            commands, reports = self.scenario.drive.identifiers()
            if fault.target in ("commands", "feedback"):
                link, hit_by = ("drive", commands) if fault.target == "commands" else ("controller", reports)
                return [(self.links[link], (fault, hit_by))]
        to_drive = {
            "commands": (own.command,),
            "all": ("Sync", "SafeStop", "DriveReset", "EnableAnswer", "ControllerHeartbeat", own.command),
        }
        back = (own.feedback, own.fault, own.heartbeat, own.challenge)
        to_controller = {
            "feedback": back,
            "localisation": ("CapsuleLocalisation",),
            SETPOINTS: (SETPOINT,),
            "all": (*back, "CapsuleLocalisation"),
        }
        hit = []
        for node, names, more in (("drive", to_drive, commands), ("controller", to_controller, reports)):
            if fault.target in names:
                numbers = frozenset(known[n].id for n in names[fault.target])
                hit.append((self.links[node], (fault, numbers | more if fault.target == "all" else numbers)))
        return hit


class _Burst:
    """A node at another bit rate: it destroys every frame until it is error passive."""

    def __init__(self) -> None:
        self._left = _ERRORS

    def __call__(self, start_s: float, sender: str, message: can.Message) -> bool:
        self._left -= 1
        return self._left >= 0
