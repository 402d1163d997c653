"""Soft contacts grow slower than the load: a coefficient of friction that is a power of the load."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, number

_LEAST_N = 1e-9  # load whose power is finite


class HertzianContact(Effect):
    """Level `(N/N_r)^e` over the load N: -1/3 for a sphere on a soft solid, 0 where friction is proportional to the
    load; N_r is the load at which the coefficient is stated.
    """

    id = "hertzian_contact"
    words = "a Hertzian contact"
    summary = "the coefficient of friction is a power of the load, as the area of a soft contact is"
    source = "Bowden and Tabor: friction goes with the true area; Hertz 1882: N^(2/3), an exponent of -1/3 of the level"
    kinds = frozenset({"friction"})
    needs = ("load",)
    probe = -0.05
    confounders = ("load_dependent_friction", "adhesive_contact")
    separated_by = "loads over a factor of thirty: adhesion levels off at high loads, a power law does not"

    exponent = number(0.0, "1", -0.9, 1.0)
    reference_N = number(1.0, "N", 1e-6, 1e9, fit=False)

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        return (np.maximum(np.abs(s.load), _LEAST_N) / p["reference_N"]) ** p["exponent"]
