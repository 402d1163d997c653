"""Magnetic memory of the drive's core."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, by_name, number


class MagneticHysteresis(Effect):
    """Command `u + r z`, `z' = u'/w` while |z| < 1, else held there: a loop of height 2 r whose branches meet over the
    width 2 w.

    r < 0 where the falling branch is the upper one, as in iron; r > 0 where it is the lower one.
    """

    id = "magnetic_hysteresis"
    words = "a magnetic hysteresis"
    summary = "the drive's force depends on whether its current rose or fell"
    source = "tracing catalogue 22: play in the current (Prandtl's stop, one element of Preisach's model)"
    kinds = frozenset({"coil"})
    needs = ("reversals",)
    states = ("memory",)
    grid = by_name(width=(0.005, 0.05, 0.5))
    probe = 0.01
    confounders = ("actuator_lag", "directional_asymmetry", "stribeck")
    separated_by = "the force on a blocked capsule while the current goes up and down slowly"

    remanence = number(0.0, "command", -2.0, 2.0)
    width = number(0.05, "command", 0.001, 5.0)

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return s.command + p["remanence"] * z["memory"]

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        return {"memory": np.clip(z["memory"] + s.rate * h / p["width"], -1.0, 1.0)}
