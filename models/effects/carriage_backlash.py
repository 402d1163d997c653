"""Play in the drive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter

_OFFSETS = (-0.75, -0.25, 0.25, 0.75)


@dataclass(frozen=True)
class CarriageBacklash(Effect):
    """Play after Prandtl and Ishlinskii: the mean of plays as wide as `b (1 + s q)`, `q` evenly between -1 and 1; each follows the
    command when it is more than half its width away. With `s = 0` the one play of a loose nut, with more an end that is reached softly."""

    id = "carriage_backlash"
    summary = "play in the drive"
    source = "tracing catalogue 18; Kuhnen, Eur. J. Control 9 (2003) 407"
    kinds = frozenset({"pull", "magnetic"})
    states = ("a.position_m", "b.position_m", "c.position_m", "d.position_m")
    probe = 0.0003
    look_alikes = ("directional_asymmetry", "actuator_lag", "sensor_delay")
    separated_by = "reversals at several amplitudes"

    play_m: Parameter = Parameter("play_m", 0.0, "m", 0.0, 0.008, "tracing catalogue 18", fit=True)
    softness: Parameter = Parameter("softness", 0.1, "1", 0.0, 1.3, "backlash rounded by elastic seats", fit=True)

    def command(self, s: Signals, p: Values, z: Values) -> Any:
        total: Any = 0.0
        for name in self.states:
            total = total + z[name]
        return total / len(self.states)

    def advance(self, s: Signals, p: Values, z: Values, h: Any) -> dict[str, Any]:
        new = {}
        for name, q in zip(self.states, _OFFSETS, strict=True):
            half = np.maximum(0.5 * p["play_m"] * (1 + p["softness"] * q), 0.0)
            new[name] = np.clip(z[name], s.command - half, s.command + half)
        return new
