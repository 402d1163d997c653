"""A closed loop tick by tick: estimator, supervised controller and limits around a world, a plant or a model of one."""

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from controller.drives import envelope_of
from controller.limits import Limits
from controller.model.control_model import ControlModel
from controller.signals import Action, Estimate, Measurement, Reference
from controller.step.compiled import supervisor_of
from controller.supervision.breakaway import resistance_of
from controller.supervision.contradiction import Contradiction
from controller.supervision.model_switch import ModelSwitch, Offer


class World(Protocol):
    def advance(self, command: float, until_s: float) -> Sequence[Measurement]:
        """Advance to `until_s` with the drive at `command` there; the measurements that arrived meanwhile."""
        ...


@dataclass(frozen=True, slots=True)
class Tick:
    """A tick that began at `time_s`: estimate, answer, who led, and the seconds that estimate and answer took."""

    time_s: float
    estimate: Estimate
    action: Action
    active: str
    seconds: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Asked:
    """Follow `reference` within `limits`, with a localisation of `noise_m`, from `begin_s` at rest under `command`."""

    reference: Reference
    limits: Limits
    noise_m: float
    estimator: str = "default"
    begin_s: float = 0.0
    command: float = 0.0


class ClosedLoop:
    """The `controller` of `model`, its estimator and supervisor; `offer` takes over at rest, `others` when broken."""

    def __init__(
        self,
        asked: Asked,
        model: ControlModel,
        controller: str,
        offer: Offer | None = None,
        others: Mapping[str, ControlModel] = MappingProxyType({}),
        watched: bool = True,
    ) -> None:
        """Unless `watched`, no monitor judges the model. Raises ValueError for a controller that cannot lead this
        rig.
        """
        envelope = envelope_of(model.drive, asked.limits)
        self.asked, self.tick_s = asked, model.tick_s
        self.supervisor = supervisor_of(controller, model, envelope)
        beside: dict[str, Any] = {"estimator": asked.estimator, "others": others, "watched": watched}
        self.estimator = ModelSwitch(self.supervisor, controller, model, offer, **beside)
        self._watch = Contradiction(envelope, asked.noise_m, resistance_of(model, envelope))
        self._commands: list[float] = []
        if asked.begin_s:
            still = Estimate(asked.begin_s, model.initial() * math.nan, model.initial(), lost=True)
            self.supervisor.reset(asked.begin_s, still, asked.command)
        self.estimator.begin(asked.begin_s)

    def run(self, world: World, ticks: int) -> Iterator[Tick]:
        """Each tick, once the world has gone on after it."""
        supervisor = self.supervisor
        arrived: Sequence[Measurement] = ()
        for k in range(ticks):
            now, start = self.asked.begin_s + k * self.tick_s, time.perf_counter()
            estimate = self.estimator.observe(now, supervisor.issued.command, arrived)
            middle = time.perf_counter()
            supervisor.halt(self._contradiction(arrived, now))
            supervisor.room = self._watch.breakaway.room
            action = supervisor.act(now, estimate, self.asked.reference)
            self._watch.breakaway.sent(now + self.tick_s, action.command, self.tick_s)
            seconds = middle - start, time.perf_counter() - middle
            self._commands.append(action.command)
            tick = Tick(now, estimate, action, supervisor.active, seconds)
            arrived = world.advance(action.command, now + self.tick_s)
            yield tick

    def _contradiction(self, arrived: Sequence[Measurement], now: float) -> str:
        """Why sensor and drive contradict each other at `now`, from measurements that arrived and commands so far."""
        command, reference = self.supervisor.issued.command, self.asked.reference
        reason = self._watch.drove(command, float(reference.position(np.array([now]))[0]), self.tick_s)
        for m in arrived:
            if m.channel != "position_m" or not math.isfinite(m.value):
                continue
            tick = max(round((m.stamp_s - self.asked.begin_s) / self.tick_s) - 1, 0)
            then = self._commands[tick] if tick < len(self._commands) else command
            wanted_m = float(reference.position(np.array([m.stamp_s]))[0])
            reason = reason or self._watch.saw(m.value, then, wanted_m, m.stamp_s)
        return reason
