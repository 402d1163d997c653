"""Resistance that changes steadily along the lumen."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, by_name, number


class LumenTaper(Effect):
    """Level `1 + g y + b y^2 + c y^3`, `y = r/sqrt(1 + (r/L)^2)`, `r = x - m`: narrowing lumen or capstan bend, the
    change itself changing along the way and dying out beyond the reach L of its middle m.
    """

    id = "lumen_taper"
    words = "a taper of the lumen"
    summary = "resistance changes steadily along the lumen"
    source = "tracing catalogue 11, 12"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "axis"})
    needs = ("places",)
    grid = by_name(reach_m=(0.02, 0.2))
    probe = 2.0
    confounders = ("tissue_drying", "stenosis")
    separated_by = "a return pass over the same places"
    refined_by = ("level_at_onset",)

    slope_per_m = number(0.0, "1/m", -30.0, 30.0)
    bend_per_m2 = number(0.0, "1/m^2", -600.0, 600.0)
    curl_per_m3 = number(0.0, "1/m^3", -2e4, 2e4)
    reach_m = number(0.05, "m", 0.01, 1.0)
    middle_m = number(0.0, "m", -0.3, 0.3, spread=0.05)

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        r = s.x - p["middle_m"]
        y = r / np.sqrt(1 + (r / p["reach_m"]) ** 2)
        return np.maximum(1 + (p["slope_per_m"] + (p["bend_per_m2"] + p["curl_per_m3"] * y) * y) * y, 0.05)
