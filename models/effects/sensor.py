"""Effects of the sensor."""

import math
from typing import Any

import numpy as np

from models.effects.effect import Effect, Forms, Signals, Value, Values, by_name
from models.formula import Formula, equal


class SensorBias(Effect):
    """Reading `y_0 + b`."""

    id = "sensor_bias"

    def measured(self, s: Signals, p: Values, z: Values, y: Value) -> Value:
        return y + p["bias"]


class SensorScale(Effect):
    """Reading `(1 + epsilon) y_0`."""

    id = "sensor_scale"

    def measured(self, s: Signals, p: Values, z: Values, y: Value) -> Value:
        return (1 + p["error"]) * y


class SensorDrift(Effect):
    """Reading `y_0 + c (t + k t_w (1 - exp(-t/t_w)))`: a rate c, at first `1 + k` times as much while the sensor warms
    up.
    """

    id = "sensor_drift"

    def measured(self, s: Signals, p: Values, z: Values, y: Value) -> Value:
        warmed = p["warming_s"] * (1 - np.exp(-s.t / p["warming_s"]))
        return y + p["rate_per_s"] * (s.t + p["quicker"] * warmed)


class SensorDelay(Effect):
    """Reading `y_0(t - d)`."""

    id = "sensor_delay"

    def delay(self, p: Values) -> Value:
        return p["delay_s"]


class SensorLowpass(Effect):
    """Reading `tau y' = y_0 - y`."""

    id = "sensor_lowpass"
    states = ("smooth",)
    follows = by_name(smooth="position")

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

    def measured(self, s: Signals, p: Values, z: Values, y: Value) -> Value:
        return y + p["hum"] * np.sin(2 * math.pi * p["frequency_Hz"] * s.t + p["phase_rad"])
