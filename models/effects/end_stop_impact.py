"""The inner mass reaches its stops."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from models.effects.effect import Values
from models.effects.inner_mass import InnerMassEffect
from models.parameter import Parameter


@dataclass(frozen=True)
class EndStopImpact(InnerMassEffect):
    """Elastic stops on both sides: `k_s (|xi| - gap)` against the displacement beyond `gap`."""

    id = "end_stop_impact"
    summary = "the inner mass hits a stop"
    source = "literature 1.1, stops k2 and k3"
    kinds = frozenset({"vibro", "vibro_table"})
    grid = MappingProxyType({"gap_m": (0.005, 0.01, 0.015)})
    probe = 300.0
    look_alikes = ("spring_hardening",)
    separated_by = "two drive amplitudes; the sound of the impacts"

    stiffness_N_per_m: Parameter = Parameter("stiffness_N_per_m", 0.0, "N/m", 0.0, 3000.0, "rubber stops", fit=True)
    gap_m: Parameter = Parameter("gap_m", 0.01, "m", 0.003, 0.03, "travel of the inner mass", fit=True)

    def suspension(self, stretch: Any, rate: Any, p: Values) -> Any:
        beyond = np.maximum(np.abs(stretch) - p["gap_m"], 0.0)
        return p["stiffness_N_per_m"] * np.sign(stretch) * beyond
