"""What a controller node is given, and what a tick of it comes to."""

from __future__ import annotations

import math
from dataclasses import dataclass

from controller.limits import Limits
from controller.prediction import ControlModel
from controller.signals import Action, Array, Estimate, Reference
from controller.succession import Offer
from hil.nodes.guard import Passed


@dataclass(frozen=True)
class Task:
    """What a controller node is built from: the control model (its tick is the bus's), the name of a controller in
    `controller.choices`, where to go, and the limits. `seen_noise_m` is the noise the localisation is believed to have. `deadline_s`
    is what the MPC's plan may take of a tick (inf, as lockstep needs it, where no clock decides). `offer` is a model that
    is to take over at a rest."""

    model: ControlModel
    controller: str
    reference: Reference
    limits: Limits
    seen_noise_m: float = 5e-4
    deadline_s: float = math.inf
    offer: Offer | None = None


@dataclass(frozen=True, slots=True)
class Tick:
    """What one tick came to: `time_s` it was computed for, what was believed and wanted, what the guard let out, and the time in s
    that estimate and controller took."""

    time_s: float
    estimate: Estimate
    action: Action
    passed: Passed
    state: int
    active: str
    seconds: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Shifted:
    """A reference that begins at `origin_s` of the node's clock."""

    path: Reference
    origin_s: float

    def position(self, t: Array) -> Array:
        return self.path.position(t - self.origin_s)

    def speed(self, t: Array) -> Array:
        return self.path.speed(t - self.origin_s)
