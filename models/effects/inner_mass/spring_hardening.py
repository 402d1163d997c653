"""A suspension that grows stiffer, or softer, with displacement."""

import numpy as np

from models.effects.effect import InnerMassEffect, Value, Values, number

TRAVEL_M = 0.03
"""Beyond it the hardening of the spring and the reach of the coil stay what they are there."""
AT_M = 0.01
"""Displacement at which the hardening has the same force whatever its power is."""
_REST_M = 1e-6  # stretch whose power is finite


class SpringHardening(InnerMassEffect):
    """Force `k_3 x_0^2 (min(|xi|, 30 mm)/x_0)^(n - 1) xi` beside the linear spring, x_0 = 10 mm; `k_3 xi^3` where the
    power n is 3. Odd, so forward and backward stay mirrored.
    """

    id = "spring_hardening"
    words = "a hardening spring"
    summary = "the suspension stiffens with displacement"
    source = "Duffing spring"
    kinds = frozenset({"vibro", "vibro_table"})
    probe = 1.0e5
    confounders = ("end_stop_impact",)
    separated_by = "two drive amplitudes; a static force-displacement curve of the spring"

    cubic_N_per_m3 = number(0.0, "N/m^3", -2.0e5, 1.0e6, "half the linear force at 10 mm")
    power = number(3.0, "1", 1.5, 5.0, "a Duffing spring has 3")

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        far = np.minimum(np.maximum(np.abs(stretch), _REST_M), TRAVEL_M) / AT_M
        return p["cubic_N_per_m3"] * AT_M**2 * far ** (p["power"] - 1) * stretch
