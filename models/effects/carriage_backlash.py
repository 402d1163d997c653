"""Play in the drive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter


@dataclass(frozen=True)
class CarriageBacklash(Effect):
    """Play: the carriage follows the command when it is more than `b/2` away."""

    id = "carriage_backlash"
    summary = "play in the drive"
    source = "tracing catalogue 18"
    kinds = frozenset({"pull", "magnetic"})
    states = ("position_m",)
    probe = 0.0003
    look_alikes = ("directional_asymmetry", "actuator_lag", "sensor_delay")
    separated_by = "reversals at several amplitudes"

    play_m: Parameter = Parameter("play_m", 0.0, "m", 0.0, 0.008, "tracing catalogue 18", fit=True)

    def command(self, s: Signals, p: Values, z: Values) -> Any:
        return z["position_m"]

    def advance(self, s: Signals, p: Values, z: Values, h: Any) -> dict[str, Any]:
        half = p["play_m"] / 2
        return {"position_m": np.clip(z["position_m"], s.command - half, s.command + half)}
