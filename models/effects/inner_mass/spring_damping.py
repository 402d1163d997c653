"""Damping of the inner mass's suspension."""

from models.effects.effect import InnerMassEffect, Value, Values, number


class SpringDamping(InnerMassEffect):
    """Force `c xi'` against the relative motion; linear, so equal losses forward and backward."""

    id = "spring_damping"
    words = "a damped suspension"
    summary = "damping of the inner mass's suspension"
    source = "literature 1.1, F_i = k1 r + c r'"
    kinds = frozenset({"vibro", "vibro_table"})
    probe = 0.5
    confounders = ("guide_friction", "viscous_drag")
    separated_by = "ring-down of the inner mass with the body held: exponential for damping, straight for dry friction"
    refined_by = ("damping_over_speed",)

    damping_N_s_per_m = number(0.0, "N s/m", 0.0, 5.0, "up to about half of critical")

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        return p["damping_N_s_per_m"] * rate
