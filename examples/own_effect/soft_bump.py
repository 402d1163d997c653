"""An effect of one's own: a bump in the lumen that pushes the capsule away from its middle, as a soft polyp would."""

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter


@dataclass(frozen=True)
class SoftBump(Effect):
    """Force `F (x - c)/w exp(1/2 - ((x - c)/w)^2/2)` along +x: it pushes away from the place c, most at c +- w."""

    id = "soft_bump"
    summary = "a soft bump that pushes the capsule away from its middle"
    source = "example"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    confounders = ("stenosis", "incline_gravity")
    separated_by = (
        "pass the place in both directions: a narrow place resists both ways, a bump pushes one way on each side"
    )
    probe = 0.01
    grid = MappingProxyType({"place_m": (-9e-3, -6e-3, -3e-3, 0.0, 3e-3, 6e-3, 9e-3)})

    force_N: Parameter = Parameter("force_N", 0.0, "N", -0.2, 0.2, "as large as the friction", fit=True)
    place_m: Parameter = Parameter("place_m", 0.0, "m", -0.1, 0.1, "anywhere on the track", fit=True)
    width_m: Parameter = Parameter("width_m", 2e-3, "m", 0.5e-3, 0.02, "a capsule's length at most", fit=True)

    def force(self, s: Signals, p: Values, z: Values) -> Any:
        """Extra force on the capsule along +x in N."""
        r = (s.x - p["place_m"]) / p["width_m"]
        return p["force_N"] * r * np.exp(0.5 - 0.5 * r * r)
