"""Effects of an inner mass on its spring."""

import numpy as np

from models.effects.effect import InnerMassEffect, Value, Values, by_name, number
from models.formula import named, shown_as


class SpringDamping(InnerMassEffect):
    """Force `c xi'` against the relative motion: linear, so the losses forward and backward are equal."""

    id = "spring_damping"
    source = "literature 1.1, F_i = k1 r + c r'"
    kinds = frozenset({"vibro", "vibro_table"})
    probe = 0.5
    confounders = ("guide_friction", "viscous_drag")
    refined_by = ("damping_over_speed",)

    damping_N_s_per_m = number(0.0, "N s/m", 0.0, 5.0, "up to about half of critical", symbol="c")

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
    source = "Duffing spring"
    kinds = frozenset({"vibro", "vibro_table"})
    probe = 1.0e5
    confounders = ("end_stop_impact",)

    cubic_N_per_m3 = number(0.0, "N/m^3", -2.0e5, 1.0e6, "half the linear force at 10 mm", symbol="k_3")
    power = number(3.0, "1", 1.5, 5.0, "a Duffing spring has 3", symbol="n")

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        size = shown_as(np.minimum(np.maximum(np.abs(stretch), _REST_M), TRAVEL_M), lambda: np.abs(stretch))
        xi_0 = named("xi_0", AT_M, stretch)
        far = size / xi_0
        return p["cubic_N_per_m3"] * xi_0**2 * far ** (p["power"] - 1) * stretch


CREEP_SPEED = 2.0e-3  # m/s, below which dry friction passes through 0


class GuideFriction(InnerMassEffect):
    """Force `F_d xi'/sqrt(xi'^2 + v_0^2)`, v_0 = 2 mm/s: constant against the relative motion, hardly any at rest."""

    id = "guide_friction"
    source = "Coulomb friction of a plain bearing"
    kinds = frozenset({"vibro", "vibro_table"})
    confounders = ("spring_damping",)

    friction_N = number(0.0, "N", 0.0, 0.6, "up to the inner mass's weight", symbol="F_d")

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        return p["friction_N"] * rate / np.sqrt(rate * rate + named("v_0", CREEP_SPEED, rate) ** 2)


class EndStopImpact(InnerMassEffect):
    """Stops on both sides: force `k max(d + t_s d', 0)` where the displacement beyond the gap, `d = |xi| - g`, is above
    0. The loss time t_s damps the impact (Kelvin-Voigt); a stop never pulls.
    """

    id = "end_stop_impact"
    source = "literature 1.1, stops k2 and k3"
    kinds = frozenset({"vibro", "vibro_table"})
    grid = by_name(gap_m=(0.002, 0.004, 0.007, 0.012))
    probe = 300.0
    confounders = ("spring_hardening",)

    stiffness_N_per_m = number(0.0, "N/m", 0.0, 5e4, "rubber to plastic stops", symbol="k")
    gap_m = number(0.01, "m", 0.0005, 0.03, "travel of the inner mass", symbol="g")
    loss_s = number(2e-4, "s", 0.0, 5e-3, "loss factor of rubber 0.05 to 1 at 100 Hz", symbol="t_s")

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        beyond = named("d", np.maximum(np.abs(stretch) - p["gap_m"], 0.0))
        pressed = np.maximum(beyond + p["loss_s"] * np.sign(stretch) * rate, 0.0)
        return p["stiffness_N_per_m"] * np.where(beyond > 0, np.sign(stretch) * pressed, 0.0)
