"""The magnet's attraction across the lumen presses the capsule on what it lies on."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter

_SOURCE = "K. W. Yung et al., Magn. Electr. Sep. 9 (1998) 39: two dipoles attract each other across the gap"


@dataclass(frozen=True)
class MagnetNormalLoad(Effect):
    """Normal load `N_m/(1 + (g/w)^2)^2` on the gap g of carriage and capsule: most where the magnet stands above the
    capsule. For rigs that only know the spring; a rig file with `[rig.magnet]` has the load from both moments.
    """

    id = "magnet_normal_load"
    summary = "the magnet presses the capsule on the wall, the more the nearer it is"
    source = _SOURCE
    kinds = frozenset({"magnetic"})
    needs = ("both_ways",)
    grid = MappingProxyType({"width_m": (0.012, 0.03)})
    probe = 0.2
    confounders = ("stribeck", "coupling_decay")
    separated_by = "the same motion with the magnet at another height: the load changes, the tissue's friction does not"

    load_N: Parameter = Parameter("load_N", 0.0, "N", 0.0, 5.0, _SOURCE, fit=True)
    width_m: Parameter = Parameter("width_m", 0.02, "m", 0.003, 0.3, _SOURCE, fit=True)

    def normal_load(self, s: Signals, p: Values, z: Values) -> Any:
        apart = (s.command - s.x) / p["width_m"]
        return p["load_N"] / (1 + apart * apart) ** 2
