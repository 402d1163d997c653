"""The sensor's gain is off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter


@dataclass(frozen=True)
class SensorScale(Effect):
    """Output `(1 + e) y`."""

    id = "sensor_scale"
    summary = "the sensor's gain is off"
    source = "tracing catalogue 24"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    probe = 0.02
    confounders = ("small_strain_stiffening",)
    separated_by = "a known load; a known distance"

    error: Parameter = Parameter("error", 0.0, "1", -0.5, 0.5, "tracing catalogue 24", fit=True)

    def measured(self, s: Signals, p: Values, z: Values, y: Any) -> Any:
        return y * (1 + p["error"])
