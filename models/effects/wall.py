"""Effects of the wall: its rate, its stiffness at small strain, its recovery."""

import numpy as np

from models.effects.effect import Effect, Forms, Signals, Value, Values, by_name, number
from models.formula import equal, named, shown_as, symbols
from models.laws.five_elements import DynamicModulus, springpot_modulus


class WallViscosity(Effect):
    """Wall force `c u_w'` beside the tension; the wall slips by its tension alone."""

    id = "wall_viscosity"
    source = "rat gut SLS, WJG 11:4974"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "periods"})
    needs = ("speeds",)
    probe = 0.3
    confounders = ("viscous_drag", "small_strain_stiffening")
    refined_by = ("viscosity_thinning",)

    viscosity_N_s_per_m = number(0.0, "N s/m", -1.0, 30.0, symbol="c")

    def wall_force(self, s: Signals, p: Values, z: Values) -> Value:
        return p["viscosity_N_s_per_m"] * s.drag_rate


_NO_TAIL = 1e-3  # exponent of a tail that is none


class SmallStrainStiffening(Effect):
    """Tension `T(u_w) (1 + a (1 + m |u_w|/u_0)^(-1/m))`, at m = 0 `exp(-|u_w|/u_0)`: extra stiffness that is gone where
    quasi-static tests measured.

    u_w is the wall's displacement, a the excess at zero stretch, u_0 the displacement over which it fades, with a tail
    m. The tension stays monotone for `a < e^2` at m = 0.
    """

    id = "small_strain_stiffening"
    source = "paper A Table 2 against A Eq. 1, 3, 12: eight periods, 2.6 times stiffer below 0.1 mm"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "periods"})
    grid = by_name(scale_m=(5e-5, 1e-4, 2e-4, 6e-4), tail=(0.3,))
    probe = 0.3
    confounders = ("wall_viscosity", "exponential_recovery")

    excess = number(0.0, "1", -0.8, 7.0, symbol="a")
    scale_m = number(2e-4, "m", 2e-5, 2e-3, "between A's 0.03 mm and the mm of quasi-static tests", symbol="u_0")
    tail = number(_NO_TAIL, "1", _NO_TAIL, 2.0, "tissue softens over more than one scale", spread=0.5, symbol="m")

    def stiffening(self, s: Signals, p: Values, z: Values) -> Value:
        m, strain = p["tail"], np.abs(s.drag) / p["scale_m"]
        fading = shown_as(
            np.exp(-np.log1p(p["tail"] * np.abs(s.drag) / p["scale_m"]) / m), lambda: (1 + m * strain) ** (-1 / m)
        )
        return 1 + p["excess"] * fading


class ExponentialRecovery(Effect):
    """Speed `v_i0 (1 - q + q m |u_w|/u_c)`: constant at q = 0, exponential with `t_r/m` at q = 1."""

    id = "exponential_recovery"
    source = "paper A Section 3.2 (real contraction is nonlinear)"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    confounders = ("wall_viscosity",)

    share = number(0.0, "1", -0.5, 1.5, symbol="q")
    times = number(3.0, "1", 0.5, 10.0, "95 % of an exponential within t_r", spread=1.0, symbol="m")

    def recovery(self, s: Signals, p: Values, z: Values, speed: Value, onset: Value) -> Value:
        return speed * (1 - p["share"] + p["share"] * p["times"] * np.abs(s.drag) / onset)


REFERENCE_HZ = 10.0  # at which the stiffness is stated


class BroadRelaxation(Effect):
    """Modulus `K (i f/10 Hz)^alpha` beside the wall's: a continuous, power-law spectrum.

    `f` in Hz, any shape; `K` in Pa at 10 Hz; `alpha` from near 0 (spring) to 0.6, nearer 1 it would be one damper and
    no broad spectrum.
    """

    id = "broad_relaxation"
    source = "fractional Kelvin-Voigt solid; soft tissue exponents 0.1 to 0.4"
    kinds = frozenset({"dma"})
    grid = by_name(exponent=(0.1, 0.25, 0.4, 0.6))
    probe = 1e4

    stiffness_Pa = number(0.0, "Pa", 0.0, 1e7, symbol="K")
    exponent = number(0.25, "1", 0.02, 0.6, symbol="alpha")

    def modulus(self, frequency_Hz: Value, p: Values) -> DynamicModulus:
        """Storage and loss modulus in Pa that the springpot adds at `frequency_Hz`, any shape."""
        return springpot_modulus(frequency_Hz / REFERENCE_HZ, 0.0, p["stiffness_Pa"], p["exponent"])

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        i, f, G = symbols("i f G_extra")
        return {"modulus": [equal(G, p["stiffness_Pa"] * (i * f / named("f_0", REFERENCE_HZ, f)) ** p["exponent"])]}
