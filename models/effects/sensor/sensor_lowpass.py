"""The measurement is smoothed."""

from typing import Any, ClassVar

import numpy as np

from models.effects.effect import Effect, Signals, Values, by_name, number


class SensorLowpass(Effect):
    """Output `tau y' + y = x`."""

    id = "sensor_lowpass"
    words = "a slow sensor"
    summary = "the measurement is smoothed"
    source = "tracing catalogue 26"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    states = ("smooth",)
    follows = by_name(smooth="position")
    probe = 0.005
    confounders: ClassVar[tuple[str, ...]] = ("sensor_delay",)
    separated_by = "the phase saturates at 90 degrees"
    refined_by: ClassVar[tuple[str, ...]] = ("further_lowpass", "sensor_delay")

    time_s = number(0.0, "s", 0.0, 0.5)

    def measured(self, s: Signals, p: Values, z: Values, y: Any) -> Any:
        return z["smooth"]

    def follow(self, s: Signals, p: Values, z: Values, y: Any, h: Any) -> dict[str, Any]:
        keep = np.where(s.t > 0, np.exp(-h / np.maximum(p["time_s"], 1e-9)), 0.0)
        return {"smooth": y + (z["smooth"] - y) * keep}
