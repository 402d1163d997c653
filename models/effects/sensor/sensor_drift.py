"""The sensor's zero drifts with time."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, number

_FORM = "an amplifier warms up within a minute, then drifts on"


class SensorDrift(Effect):
    """Output `y + c (t + k t_w (1 - exp(-t/t_w)))`: a rate c, at first `1 + k` times as much while the sensor warms."""

    id = "sensor_drift"
    words = "a drifting sensor"
    summary = "the sensor's zero drifts"
    source = "tracing catalogue 24"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("time",)
    probe = 1e-05
    confounders = ("tissue_drying", "respiration")
    separated_by = "a reference stop; two sensors"

    rate_per_s = number(0.0, "of the measured unit/s", -0.01, 0.01)
    quicker = number(0.0, "1", -1.0, 30.0, _FORM, spread=5.0)
    warming_s = number(15.0, "s", 3.0, 200.0, _FORM, spread=30.0)

    def measured(self, s: Signals, p: Values, z: Values, y: Value) -> Value:
        warmed = p["warming_s"] * (1 - np.exp(-s.t / p["warming_s"]))
        return y + p["rate_per_s"] * (s.t + p["quicker"] * warmed)
