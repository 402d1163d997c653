"""A spring between an axis and its frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter

_SOURCE = "Hooke's law; balancing springs, cables and hoses of machine axes"


@dataclass(frozen=True)
class SpringOverPosition(Effect):
    """Force `-k x`; where the spring is at rest goes into the axis' constant force."""

    id = "spring_over_position"
    summary = "a spring to the frame: a force proportional to the position"
    source = _SOURCE
    kinds = frozenset({"axis"})
    needs = ("places",)
    probe = 10.0
    confounders = ("gravity_over_angle", "lumen_taper")
    separated_by = "hold still at several places over the whole travel; swing over more than half a turn"

    stiffness_N_per_m: Parameter = Parameter("stiffness_N_per_m", 0.0, "N/m", -1e5, 1e5, _SOURCE, fit=True)

    def force(self, s: Signals, p: Values, z: Values) -> Any:
        return -p["stiffness_N_per_m"] * s.x
