"""Effects of an inner mass on its spring."""

import numpy as np

from models.effects.effect import InnerMassEffect, Value, Values
from models.formula import named, shown_as


class SpringDamping(InnerMassEffect):
    """Force `c xi'` against the relative motion: linear, so the losses forward and backward are equal."""

    id = "spring_damping"

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        return p["damping_N_s_per_m"] * rate


TRAVEL_M = 0.03
"""Beyond it the hardening of the spring and the reach of the coil stay what they are there."""
AT_M = 0.01
"""Displacement at which the hardening has the same force whatever its power is."""
_REST_M = 1e-6  # stretch whose power is finite


class SpringHardening(InnerMassEffect):
    """Force `k_3 xi_0^2 (|xi|/xi_0)^(n - 1) xi` beside the linear spring, xi_0 = 10 mm, |xi| at most 30 mm; `k_3 xi^3`
    where n is 3. Odd, so forward and backward stay mirrored.
    """

    id = "spring_hardening"

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        size = shown_as(np.minimum(np.maximum(np.abs(stretch), _REST_M), TRAVEL_M), lambda: np.abs(stretch))
        xi_0 = named("xi_0", AT_M, stretch)
        far = size / xi_0
        return p["cubic_N_per_m3"] * xi_0**2 * far ** (p["power"] - 1) * stretch


CREEP_SPEED = 2.0e-3  # m/s, below which dry friction passes through 0


class GuideFriction(InnerMassEffect):
    """Force `F_d xi'/sqrt(xi'^2 + v_0^2)`, v_0 = 2 mm/s: constant against the relative motion, hardly any at rest."""

    id = "guide_friction"

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        return p["friction_N"] * rate / np.sqrt(rate * rate + named("v_0", CREEP_SPEED, rate) ** 2)


class EndStopImpact(InnerMassEffect):
    """Stops on both sides: force `k max(d + t_s d', 0)` where the displacement beyond the gap, `d = |xi| - g`, is above
    0. The loss time t_s damps the impact (Kelvin-Voigt); a stop never pulls.
    """

    id = "end_stop_impact"

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        beyond = named("d", np.maximum(np.abs(stretch) - p["gap_m"], 0.0))
        pressed = np.maximum(beyond + p["loss_s"] * np.sign(stretch) * rate, 0.0)
        return p["stiffness_N_per_m"] * np.where(beyond > 0, np.sign(stretch) * pressed, 0.0)
