"""A suspension that grows stiffer, or softer, with displacement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.effects.effect import InnerMassEffect, Values
from models.parameter import Parameter

TRAVEL_M = 0.03


@dataclass(frozen=True)
class SpringHardening(InnerMassEffect):
    """Force `k_3 min(|xi|, 30 mm)^2 xi` beside the linear spring; odd, so forward and backward stay mirrored."""

    id = "spring_hardening"
    summary = "the suspension stiffens with displacement"
    source = "Duffing spring"
    kinds = frozenset({"vibro", "vibro_table"})
    probe = 1.0e5
    confounders = ("end_stop_impact",)
    separated_by = "two drive amplitudes; a static force-displacement curve of the spring"

    cubic_N_per_m3: Parameter = Parameter(
        "cubic_N_per_m3", 0.0, "N/m^3", -2.0e5, 1.0e6, "half the linear force at 10 mm", fit=True
    )

    def suspension(self, stretch: Any, rate: Any, p: Values) -> Any:
        return p["cubic_N_per_m3"] * np.minimum(np.abs(stretch), TRAVEL_M) ** 2 * stretch
