"""A constant force along the lumen."""

from models.effects.effect import Effect, Signals, Value, Values, number


class InclineGravity(Effect):
    """Constant force along +x, `m g sin(alpha)` of a tilted lumen."""

    id = "incline_gravity"
    words = "an inclined lumen"
    summary = "a constant force along the lumen"
    source = "tracing catalogue 13"
    kinds = frozenset({"magnetic", "coil", "vibro", "vibro_table", "pull"})
    probe = 0.002
    confounders = ("directional_asymmetry", "sensor_bias")
    separated_by = "tilt the rig by a known angle; records at rest"

    force_N = number(0.0, "N", -0.5, 0.5)

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return p["force_N"]
