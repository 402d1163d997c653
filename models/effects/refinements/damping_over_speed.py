"""Damping of the suspension as a free curve over the inner mass's speed: what a named damping leaves of its shape."""

import itertools

import numpy as np

from models.effects.effect import InnerMassEffect, Value, Values, number

KNOTS_M_S = (0.0, 0.1, 0.2, 0.4, 0.8)  # of the curve, over the inner mass's speed


class DampingOverSpeed(InnerMassEffect):
    """Force `c(|xi'|) xi'`: c is 0 at rest, straight between knots at 0.1, 0.2, 0.4 and 0.8 m/s, constant beyond; `c_k`
    are its values there. Refines an effect, never named itself.
    """

    id = "damping_over_speed"
    words = "a free curve of damping over speed"
    summary = "damping of the suspension as a free curve over speed"
    source = "no law: a curve through the speeds that the records contain"
    kinds = frozenset({"vibro"})
    probe = 0.05
    confounders = ("spring_damping", "guide_friction")
    separated_by = "ring-down of the inner mass from several amplitudes"

    c_1, c_2, c_3, c_4 = (number(0.0, "N s/m", -2.0, 2.0, spread=0.2) for _ in range(4))

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        damping, below = 0.0, 0.0
        for k, (low, high) in enumerate(itertools.pairwise(KNOTS_M_S), start=1):
            damping = damping + (p[f"c_{k}"] - below) * np.clip((np.abs(rate) - low) / (high - low), 0.0, 1.0)
            below = p[f"c_{k}"]
        return damping * rate
