"""Resistance as a free curve over speed: what a named law of speed leaves of its shape. Never named itself."""

import itertools

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, number
from models.parameter import Parameter

KNOTS_M_S = (0.0, 0.0002, 0.0005, 0.001, 0.002, 0.004, 0.008, 0.016)  # of the curve, each about twice the one before


def _knot() -> Parameter:
    return number(0.0, "1", -0.5, 0.5, spread=0.003)


class LevelOverSpeed(Effect):
    """Level `1 + e(|v|) + d o(|v|)`, d the direction of motion (at rest the last one): both curves straight between
    knots at 0, 0.2, 0.5, 1, 2, 4, 8 and 16 mm/s, constant beyond. `even_k` and `odd_k` are their values at the
    knots.
    """

    id = "level_over_speed"
    words = "a free curve of friction over speed"
    summary = "resistance as a free curve over speed"
    source = "no law: a curve through the speeds that the records contain"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    by_speed = True
    probe = 0.02
    confounders = ("stribeck", "viscous_drag", "directional_asymmetry")
    separated_by = "speeds over two decades"

    even_1, even_2, even_3, even_4, even_5, even_6, even_7, even_8 = (_knot() for _ in range(8))
    odd_1, odd_2, odd_3, odd_4, odd_5, odd_6, odd_7, odd_8 = (_knot() for _ in range(8))

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        even, odd = p["even_1"], p["odd_1"]
        for k, (low, high) in enumerate(itertools.pairwise(KNOTS_M_S), start=1):
            share = np.clip((np.abs(s.v) - low) / (high - low), 0.0, 1.0)
            even = even + (p[f"even_{k + 1}"] - p[f"even_{k}"]) * share
            odd = odd + (p[f"odd_{k + 1}"] - p[f"odd_{k}"]) * share
        return np.maximum(1 + even + s.direction * odd, 0.05)
