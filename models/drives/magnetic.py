"""A magnet on a carriage outside the body: a magnetic spring with a finite range."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from models.drives.drive import Drive
from models.parameter import Parameter


@dataclass(frozen=True)
class Magnetic(Drive):
    """Imposed carriage position in m; force `k g/(1 + (g/r)^2)^2` on the gap `g = carriage - capsule`, largest at `g =
    r/sqrt(3)`.
    """

    name: ClassVar[str] = "magnetic"
    commanded: ClassVar[str] = "carriage_position_m"
    measured: ClassVar[str] = "position_m"
    anchored: ClassVar[bool] = True
    stiffness_N_per_m: float = 25.0
    range_m: float = 0.02

    def parameters(self) -> tuple[Parameter, ...]:
        k = self.stiffness_N_per_m
        return (
            Parameter(
                "magnet_stiffness_N_per_m", k, "N/m", 0.85 * k, 1.15 * k, "rig file; several percent off", fit=True
            ),
        )

    def force(self, x: Any, v: Any, command: Any, p: Mapping[str, Any]) -> Any:
        gap = command - x
        return p["magnet_stiffness_N_per_m"] * gap / (1 + (gap / self.range_m) ** 2) ** 2
