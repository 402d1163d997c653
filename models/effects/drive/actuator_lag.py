"""First-order lag of the drive."""

from typing import Any, ClassVar

import numpy as np

from models.effects.effect import Effect, Signals, Values, by_name, number


class ActuatorLag(Effect):
    """Lag `tau c' = command - c`, exact for a ramp within the step."""

    id = "actuator_lag"
    words = "a lagging drive"
    summary = "first-order lag of the drive"
    source = "first-order drive"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    states = ("command",)
    follows = by_name(command="command")
    probe = 0.005
    confounders: ClassVar[tuple[str, ...]] = ("sensor_delay", "sensor_lowpass", "carriage_backlash", "coil_lag")
    separated_by = "time-stamped edges; phase against frequency"
    refined_by: ClassVar[tuple[str, ...]] = ("sensor_delay", "further_lag")

    time_s = number(0.0, "s", 0.0, 1.0)

    def command(self, s: Signals, p: Values, z: Values) -> Any:
        return z["command"]

    def response(self, p: Values) -> Any:
        return p["time_s"]

    def advance(self, s: Signals, p: Values, z: Values, h: Any) -> dict[str, Any]:
        tau = np.maximum(p["time_s"], 1e-9)
        rise = p["time_s"] * (1 - np.exp(-h / tau))
        start = s.command - s.rate * h
        return {"command": s.command - s.rate * rise + (z["command"] - start) * np.exp(-h / tau)}
