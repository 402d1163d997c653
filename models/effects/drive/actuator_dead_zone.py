"""A dead zone of the drive."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, number


class ActuatorDeadZone(Effect):
    """Command `sgn(u) max(|u| - d, 0)`."""

    id = "actuator_dead_zone"
    words = "a dead zone of the drive"
    summary = "a dead zone of the drive"
    source = "tracing catalogue 17"
    kinds = frozenset({"coil"})
    probe = 0.01
    confounders = ("stribeck", "dwell_adhesion")
    separated_by = "small-signal drive"

    zone = number(0.0, "of the command", 0.0, 1.0)

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return np.sign(s.command) * np.maximum(np.abs(s.command) - p["zone"], 0.0)
