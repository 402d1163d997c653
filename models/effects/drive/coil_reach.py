"""The coil's force changes with the inner mass's place in it."""

import numpy as np

from models.effects.effect import InnerMassEffect, Value, Values, number
from models.effects.inner_mass.spring_hardening import TRAVEL_M


class CoilReach(InnerMassEffect):
    """Force `F exp(g xi)`, as of a coil whose inductance falls exponentially along it, `F = i^2/2 |dL/dxi|`, within 30
    mm.

    It acts only while the coil is on, so forward and backward differ; `g < 0` where the push carries the mass out of
    the field.
    """

    id = "coil_reach"
    words = "a coil force that depends on displacement"
    summary = "the coil's force changes with the inner mass's displacement"
    source = "reluctance coil, literature 1.2"
    kinds = frozenset({"vibro", "vibro_table"})
    probe = 10.0
    confounders = ("coil_lag", "directional_asymmetry")
    separated_by = "the static force of the coil over displacement"

    gain_per_m = number(0.0, "1/m", -60.0, 60.0, "a factor of e over 16 mm")

    def reach(self, stretch: Value, p: Values) -> Value:
        return np.exp(p["gain_per_m"] * np.clip(stretch, -TRAVEL_M, TRAVEL_M))
