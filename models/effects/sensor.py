"""Effects of the sensor."""

import math
from typing import Any, ClassVar

import numpy as np

from models.effects.effect import Effect, Forms, Signals, Value, Values, by_name, number
from models.formula import Formula, equal


class SensorBias(Effect):
    """Reading `y_0 + b`."""

    id = "sensor_bias"
    source = "tracing catalogue 24"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    probe = 0.001
    confounders = ("incline_gravity", "directional_asymmetry")

    bias = number(0.0, "of the measured unit", -0.5, 0.5, symbol="b")

    def measured(self, s: Signals, p: Values, z: Values, y: Value) -> Value:
        return y + p["bias"]


class SensorScale(Effect):
    """Reading `(1 + epsilon) y_0`."""

    id = "sensor_scale"
    source = "tracing catalogue 24"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    probe = 0.02
    confounders = ("small_strain_stiffening",)

    error = number(0.0, "1", -0.5, 0.5, symbol="epsilon")

    def measured(self, s: Signals, p: Values, z: Values, y: Value) -> Value:
        return (1 + p["error"]) * y


_WARMING = "an amplifier warms up within a minute, then drifts on"


class SensorDrift(Effect):
    """Reading `y_0 + c (t + k t_w (1 - exp(-t/t_w)))`: a rate c, at first `1 + k` times as much, as it warms up."""

    id = "sensor_drift"
    source = "tracing catalogue 24"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("time",)
    probe = 1e-05
    confounders = ("tissue_drying", "respiration")

    rate_per_s = number(0.0, "of the measured unit/s", -0.01, 0.01, symbol="c")
    quicker = number(0.0, "1", -1.0, 30.0, _WARMING, spread=5.0, symbol="k")
    warming_s = number(15.0, "s", 3.0, 200.0, _WARMING, spread=30.0, symbol="t_w")

    def measured(self, s: Signals, p: Values, z: Values, y: Value) -> Value:
        warmed = p["warming_s"] * (1 - np.exp(-s.t / p["warming_s"]))
        return y + p["rate_per_s"] * (s.t + p["quicker"] * warmed)


class SensorDelay(Effect):
    """Reading `y_0(t - d)`."""

    id = "sensor_delay"
    source = "tracing catalogue 25"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "axis"})
    probe = 0.005
    confounders = ("sensor_lowpass", "actuator_lag")

    delay_s = number(0.0, "s", 0.0, 0.5, symbol="d")

    def delay(self, p: Values) -> Value:
        return p["delay_s"]


class SensorLowpass(Effect):
    """Reading `tau y' = y_0 - y`."""

    id = "sensor_lowpass"
    source = "tracing catalogue 26"
    symbols = by_name(smooth="y")
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    states = ("smooth",)
    follows = by_name(smooth="position")
    probe = 0.005
    confounders: ClassVar[tuple[str, ...]] = ("sensor_delay",)
    refined_by: ClassVar[tuple[str, ...]] = ("further_lowpass", "sensor_delay")

    time_s = number(0.0, "s", 0.0, 0.5, symbol="tau")

    def measured(self, s: Signals, p: Values, z: Values, y: Any) -> Any:
        return z["smooth"]

    def follow(self, s: Signals, p: Values, z: Values, y: Any, h: Any) -> dict[str, Any]:
        keep = np.where(s.t > 0, np.exp(-h / np.maximum(p["time_s"], 1e-9)), 0.0)
        return {"smooth": y + (z["smooth"] - y) * keep}

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        return {"smooth": [equal(p["time_s"] * Formula("y'"), Formula("y_0") - z["smooth"])]}


class MainsHum(Effect):
    """Reading `y_0 + A sin(2 pi f t + phi)`."""

    id = "mains_hum"
    source = "paper C Section 2.3 (power frequency interference)"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    grid = by_name(frequency_Hz=(50.0, 60.0), phase_rad=(0.0, 1.5707963))
    probe = 0.0001
    needs = ("samples",)
    confounders = ("respiration",)

    hum = number(0.0, "of the measured unit", -0.05, 0.05, symbol="A")
    frequency_Hz = number(50.0, "Hz", 49.0, 61.0, symbol="f")
    phase_rad = number(0.0, "rad", -7.0, 7.0, role="phase", symbol="phi")

    def measured(self, s: Signals, p: Values, z: Values, y: Value) -> Value:
        return y + p["hum"] * np.sin(2 * math.pi * p["frequency_Hz"] * s.t + p["phase_rad"])
