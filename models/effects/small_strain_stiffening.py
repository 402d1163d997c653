"""A wall that is stiffer at small, fast stretch than its quasi-static law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter

_SOURCE = "paper A Table 2 against A Eq. 1, 3, 12: eight periods, 2.6 times stiffer below 0.1 mm"


@dataclass(frozen=True)
class SmallStrainStiffening(Effect):
    """Tension `T(u) (1 + a ((1 - q) exp(-|u|/u_0) + q exp(-|u|/(5 u_0))))`: extra stiffness that is gone where quasi-static tests measured.

    `u` the wall's drag in m, `a` the excess at zero stretch, `u_0` in m the drag over which it fades but for a share q, which
    fades over five times that. The tension stays monotone in `u` for `a < e^2` at q = 0.
    """

    id = "small_strain_stiffening"
    summary = "the wall is stiffer at small, fast stretch than its quasi-static law"
    source = _SOURCE
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "periods"})
    probe = 0.3
    look_alikes = ("wall_viscosity", "exponential_recovery")
    separated_by = "pulls at several speeds; step and hold of 0.05 and 0.5 mm"

    excess: Parameter = Parameter("excess", 0.0, "1", -0.8, 7.0, _SOURCE, fit=True)
    scale_m: Parameter = Parameter(
        "scale_m", 2e-4, "m", 2e-5, 2e-3, "between A's 0.03 mm and the mm of quasi-static tests", fit=True
    )
    slow: Parameter = Parameter("slow", 0.0, "1", 0.0, 0.9, "tissue softens over more than one scale", fit=True, spread=0.2)

    def stiffening(self, s: Signals, p: Values, z: Values) -> Any:
        way = np.abs(s.drag) / p["scale_m"]
        return 1 + p["excess"] * ((1 - p["slow"]) * np.exp(-way) + p["slow"] * np.exp(-way / 5))
