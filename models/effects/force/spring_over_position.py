"""A spring between an axis and its frame."""

from models.effects.effect import Effect, Signals, Value, Values, number


class SpringOverPosition(Effect):
    """Force `-k x`; where the spring is at rest goes into the axis' constant force."""

    id = "spring_over_position"
    words = "a spring to the frame"
    summary = "a spring to the frame: a force proportional to the position"
    source = "Hooke's law; balancing springs, cables and hoses of machine axes"
    kinds = frozenset({"axis"})
    needs = ("places",)
    probe = 10.0
    confounders = ("gravity_over_angle", "lumen_taper")
    separated_by = "hold still at several places over the whole travel; swing over more than half a turn"

    stiffness_N_per_m = number(0.0, "N/m", -1e5, 1e5)

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return -p["stiffness_N_per_m"] * s.x
