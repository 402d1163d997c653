"""Resistance that differs between forward and backward."""

from models.effects.effect import Effect, Signals, Value, Values, number


class DirectionalAsymmetry(Effect):
    """Level `1 + a sgn(v)`: constant while sliding, of either sign."""

    id = "directional_asymmetry"
    words = "a directional asymmetry"
    summary = "resistance differs between forward and backward"
    source = "tracing catalogue 14; EMPS, Janot et al. 2019"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "vibro_table", "axis", "friction"})
    needs = ("both_ways",)
    probe = 0.05
    confounders = ("incline_gravity", "sensor_bias")
    separated_by = "records at rest, where a constant force stays and an asymmetry does not"
    refined_by = ("level_at_onset", "level_at_creep", "level_over_speed")

    asymmetry = number(0.0, "1", -0.9, 0.9)

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        return 1 + p["asymmetry"] * s.direction
