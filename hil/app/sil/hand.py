"""Who steers by hand in simulated time: the operator of a scenario's `[jog]`, and another one beside it."""

from __future__ import annotations

import itertools
import math
from typing import Final

import can

from hil.app.scenario.bus_scenario import JogTable
from hil.app.scenario.jog_script import Step
from hil.bus.catalogue import Catalogue
from hil.nodes.controller.operator import SETPOINT
from hil.nodes.operator_sender import CYCLE_S, OperatorSender

_AFTER_S: Final = 7e-3
_GREETING_S: Final = 2 * CYCLE_S
_BACK_M_S: Final = -0.4


class Hand:
    """Sends the setpoints of `jog`, one a cycle, on `bus`. `presses` counts how often the dead-man switch went from
    released to held; once it is `let_go` it stays released.
    """

    def __init__(self, bus: can.BusABC, jog: JogTable) -> None:
        self.let_go, self.presses = False, 0
        self._now = 0.0
        self._sender = OperatorSender(bus, jog.source, jog.life_ms, clock=lambda: self._now)
        self._steps = jog.planned()
        self._ends = list(itertools.accumulate(step.seconds for step in self._steps))
        self._due_s, self._held = 0.0, False

    def speak(self, now: float) -> None:
        """Its part of the time until `now` in s: a setpoint where one is due."""
        if now < self._due_s:
            return
        self._now = now
        self._due_s += CYCLE_S
        step = None if self.let_go else self._step(now)
        held = step is not None and step.mode != "release"
        self.presses += held and not self._held
        self._held = held
        if step is None or not held:
            self._sender.release()
        elif step.mode == "speed":
            self._sender.speed(step.value)
        else:
            self._sender.position(step.value)
        self._sender.listen()

    def _step(self, now: float) -> Step | None:
        return next((step for step, end in zip(self._steps, self._ends, strict=True) if now < end), None)


class SecondOperator:
    """Another operator, from when it first speaks on: released for two cycles, then as fast backwards as a frame can
    say; as a source of its own, or as the same one, its counter beginning at 0.
    """

    def __init__(self, bus: can.BusABC, jog: JogTable, catalogue: Catalogue) -> None:
        names = catalogue[SETPOINT].field("Source").names.values()
        other = next(name for name in names if name != jog.source)
        self._now = 0.0
        self._senders = {
            target: OperatorSender(bus, source, jog.life_ms, clock=lambda: self._now)
            for target, source in (("same", jog.source), ("other", other))
        }
        self._began_s, self._due_s = math.nan, -math.inf
        self.presses = 0

    def speak(self, now: float, target: str) -> None:
        """Its part of the time until `now` in s; `target` is "same" or "other"."""
        if math.isnan(self._began_s):
            self._began_s, self._due_s = now, now + _AFTER_S
        if now < self._due_s:
            return
        self._now = now
        self._due_s += CYCLE_S
        sender = self._senders[target]
        if now - self._began_s < _AFTER_S + _GREETING_S:
            sender.release()
        else:
            self.presses += target == "same" and not self.presses
            sender.speed(_BACK_M_S)
        sender.listen()
