"""The coil's force changes with the inner mass's place in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from models.effects.effect import Values
from models.effects.inner_mass import InnerMassEffect
from models.parameter import Parameter


@dataclass(frozen=True)
class CoilReach(InnerMassEffect):
    """Force `F (1 + g xi)`, the first order of `F = i^2/2 dL/dxi`; it acts only while the coil is on, so forward and backward
    differ."""

    id = "coil_reach"
    summary = "the coil's force changes with the inner mass's displacement"
    source = "reluctance coil, literature 2.1"
    kinds = frozenset({"vibro", "vibro_table"})
    probe = 10.0
    look_alikes = ("coil_lag", "directional_asymmetry")
    separated_by = "the static force of the coil over displacement"

    gain_per_m: Parameter = Parameter("gain_per_m", 0.0, "1/m", -60.0, 60.0, "changes by half over 8 mm", fit=True)

    def reach(self, stretch: Any, p: Values) -> Any:
        return 1 + p["gain_per_m"] * stretch
