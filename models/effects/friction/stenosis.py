"""One local place of higher resistance."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, by_name, number

_END = 1e-9 - 1  # of a bump that ends, where its logarithm would


class Stenosis(Effect):
    """Level `1 + s g`, `g = (1 + m (m + 1)/2 q^2)^(-1/m)`, `q = (x - x_0)/(w (1 + k sgn(x - x_0)))`.

    The skew k makes one flank steeper; the tail m leads from a bump that ends, `(1 - q^2/8)^2` at -1/2, over a
    Gaussian, `exp(-q^2/2)` at 0, to a Lorentzian, `1/(1 + q^2)` at 1.
    """

    id = "stenosis"
    words = "a stenosis"
    summary = "one local place of higher resistance"
    source = "tracing catalogue 11"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("places",)
    grid = by_name(width_m=(0.0015, 0.004))
    probe = 0.2
    confounders = ("lumen_taper", "fold_periodic")
    separated_by = "more passes over the place, from both sides"
    refined_by = ("level_at_onset",)

    excess = number(0.0, "1", -0.9, 6.0)
    centre_m = number(0.0, "m", -0.3, 0.3, role="place")
    width_m = number(0.003, "m", 0.0005, 0.012)
    tail = number(1.0, "1", -0.6, 2.0)
    skew = number(0.0, "1", -0.6, 0.6)

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        away = s.x - p["centre_m"]
        apart = away / (p["width_m"] * (1 + p["skew"] * np.sign(away)))
        tail = p["tail"]
        bump = np.maximum(0.5 * tail * (1 + tail) * apart * apart, _END)
        return 1 + p["excess"] * np.exp(-np.log1p(bump) / tail)
