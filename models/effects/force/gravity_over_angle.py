"""The torque of a weight on a lever about an axis that turns."""

import math

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, by_name, number


class GravityOverAngle(Effect):
    """Torque `-m g l sin(x - x_0)`: 0 where the weight hangs (x_0), greatest a quarter turn from there."""

    id = "gravity_over_angle"
    words = "a weight on a lever"
    summary = "the torque of a weight on a lever, over the angle"
    source = "m g l of a lever: statics"
    kinds = frozenset({"axis"})
    needs = ("turning", "places")
    grid = by_name(hanging_rad=(0.0, 0.5 * math.pi))
    probe = 0.1
    confounders = ("spring_over_position", "fold_periodic")
    separated_by = "swing over more than half a turn; the axis laid so that gravity does no work"

    torque_N_m = number(0.0, "N m", -1e3, 1e3)
    hanging_rad = number(0.0, "rad", -7.0, 7.0, role="phase")

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return -p["torque_N_m"] * np.sin(s.x - p["hanging_rad"])
