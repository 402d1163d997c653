"""A magnet on a carriage outside the body: a magnetic spring with a finite range."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

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

    @property
    def gap_limit_m(self) -> float:
        return self.range_m / float(np.sqrt(3))

    def neutral(self, x: Any) -> Any:
        return x

    def parameters(self) -> tuple[Parameter, ...]:
        k = self.stiffness_N_per_m
        return (
            Parameter(
                "magnet_stiffness_N_per_m", k, "N/m", 0.85 * k, 1.15 * k, "rig file; several percent off", fit=True
            ),
        )

    def equations(self, p: Mapping[str, Any]) -> list[str]:
        return [f"F_act = {p['magnet_stiffness_N_per_m']:.4g} g/(1 + (g/r)^2)^2, g = carriage - capsule"]

    def untold(self) -> list[str]:
        return [
            "Only the ratios of hoop stress, friction and magnet stiffness show well in a position: the three may move"
            " together."
        ]

    def command_for(self, force: Any, x: Any, v: Any, p: Mapping[str, Any]) -> Any:
        return x + _gap(force / p["magnet_stiffness_N_per_m"], self.range_m)

    def force(self, x: Any, v: Any, command: Any, p: Mapping[str, Any]) -> Any:
        gap = command - x
        return p["magnet_stiffness_N_per_m"] * gap / (1 + (gap / self.range_m) ** 2) ** 2


def _gap(ratio: Any, reach: float) -> Any:
    """The gap g in m with `g/(1 + (g/r)^2)^2` = `ratio`, held within 0.95 of the one of greatest force; three Newton
    steps.
    """
    most = 0.95 * reach / np.sqrt(3)
    g = np.clip(ratio, -most, most)
    for _ in range(3):
        q = (g / reach) ** 2
        g = np.clip(g - (g / (1 + q) ** 2 - ratio) * (1 + q) ** 3 / (1 - 3 * q), -most, most)
    return g
