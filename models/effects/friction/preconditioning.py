"""Resistance that falls with the distance travelled over the tissue."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, by_name, number


class Preconditioning(Effect):
    """Level `1 - f (1 - (1 - q) exp(-s/l) - q exp(-5 s/l))` with the path length s: a share q of the fall comes in the
    first fifth of it, as the first of Terry's cycles took more than the later ones.
    """

    id = "preconditioning"
    words = "preconditioning of the tissue"
    summary = "resistance falls with distance travelled"
    source = "Terry 2014: 13 cycles; Mullins"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("places",)
    grid = by_name(length_m=(0.03, 0.1))
    probe = 0.05
    confounders = ("tissue_drying",)
    separated_by = "revisit the old place against a new one; wait without moving"
    refined_by = ("level_at_onset",)

    fall = number(0.0, "1", -1.0, 0.9)
    length_m = number(0.05, "m", 0.01, 0.5)
    quick = number(0.0, "1", 0.0, 0.9, "Terry 2014: the first cycle takes most", spread=0.3)

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        way = s.travelled / p["length_m"]
        return 1 - p["fall"] * (1 - (1 - p["quick"]) * np.exp(-way) - p["quick"] * np.exp(-5 * way))
