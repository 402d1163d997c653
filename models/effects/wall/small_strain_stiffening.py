"""A wall that is stiffer at small, fast stretch than its quasi-static law."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, by_name, number

_NO_TAIL = 1e-3  # exponent of a tail that is none


class SmallStrainStiffening(Effect):
    """Tension `T(u) (1 + a (1 + m |u|/u_0)^(-1/m))`, at m = 0 `exp(-|u|/u_0)`: extra stiffness that is gone where
    quasi-static tests measured.

    `u` the wall's drag in m, `a` the excess at zero stretch, `u_0` in m the drag over which it fades, with a tail m.
    The tension stays monotone in `u` for `a < e^2` at m = 0.
    """

    id = "small_strain_stiffening"
    words = "a wall stiffer at small strain"
    summary = "the wall is stiffer at small, fast stretch than its quasi-static law"
    source = "paper A Table 2 against A Eq. 1, 3, 12: eight periods, 2.6 times stiffer below 0.1 mm"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "periods"})
    grid = by_name(scale_m=(5e-5, 1e-4, 2e-4, 6e-4), tail=(0.3,))
    probe = 0.3
    confounders = ("wall_viscosity", "exponential_recovery")
    separated_by = "pulls at several speeds; step and hold of 0.05 and 0.5 mm"

    excess = number(0.0, "1", -0.8, 7.0)
    scale_m = number(2e-4, "m", 2e-5, 2e-3, "between A's 0.03 mm and the mm of quasi-static tests")
    tail = number(_NO_TAIL, "1", _NO_TAIL, 2.0, "tissue softens over more than one scale", spread=0.5)

    def stiffening(self, s: Signals, p: Values, z: Values) -> Value:
        return 1 + p["excess"] * np.exp(-np.log1p(p["tail"] * np.abs(s.drag) / p["scale_m"]) / p["tail"])
