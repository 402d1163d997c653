"""The sensor's zero drifts with time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter


@dataclass(frozen=True)
class SensorDrift(Effect):
    """Output `y + c t`."""

    id = "sensor_drift"
    summary = "the sensor's zero drifts"
    source = "tracing catalogue 24"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    probe = 1e-05
    look_alikes = ("tissue_drying", "respiration")
    separated_by = "a reference stop; two sensors"

    rate_per_s: Parameter = Parameter("rate_per_s", 0.0, "of the measured unit/s", -0.01, 0.01, "tracing catalogue 24", fit=True)

    def measured(self, s: Signals, p: Values, z: Values, y: Any) -> Any:
        return y + p["rate_per_s"] * s.t
