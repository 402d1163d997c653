"""A magnet on a carriage and one in the capsule, from their own moments: the dipoles of `models.laws.dipole`."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.drives.magnetic import Magnetic
from models.laws.dipole import PAIRINGS, Orientation, attraction, pull
from models.parameter import Parameter

_STEPS = 4  # of Newton's method


@dataclass(frozen=True)
class MagnetPair(Magnetic):
    """Imposed carriage position in m at the height `h` across the lumen: pull and attraction of two dipoles, of which
    the attraction presses the capsule on its surface. `stiffness_N_per_m` is that at `height_m`. The capsule does not
    turn, and the magnet is on the side to which its weight acts.
    """

    height_m: float = 0.15
    orientation: Orientation = "across"

    @property
    def gap_limit_m(self) -> float:
        return PAIRINGS[self.orientation].peak * self.height_m

    def parameters(self) -> tuple[Parameter, ...]:
        k = self.stiffness_N_per_m
        source = "rig file: both moments and the height; its fifth power counts"
        return (Parameter("magnet_stiffness_N_per_m", k, "N/m", 0.7 * k, 1.4 * k, source, fit=True),)

    def equations(self, p: Mapping[str, Any]) -> list[str]:
        pairing = PAIRINGS[self.orientation]
        k, h = f"{p['magnet_stiffness_N_per_m']:.4g}", f"{self.height_m:.4g}"
        return [
            f"F_act = {k} g (1 - {pairing.a:.4g} q)/(1 + q)^(7/2), g = carriage - capsule, q = (g/{h})^2",
            f"N = m g + {k} {h}/{pairing.b:.4g} (1 - {pairing.c:.4g} q)/(1 + q)^(7/2), the magnet's attraction",
        ]

    def command_for(self, force: Any, x: Any, v: Any, p: Mapping[str, Any]) -> Any:
        """Newton steps, held within 0.95 of the gap of greatest pull."""
        k, h, pairing = p["magnet_stiffness_N_per_m"], self.height_m, PAIRINGS[self.orientation]
        most = 0.95 * pairing.peak * h
        g = np.clip(force / k, -most, most)
        for _ in range(_STEPS):
            q = (g / h) ** 2
            slope = (1 - 3 * pairing.a * q) / (1 + q) ** 3.5 - 7 * q * (1 - pairing.a * q) / (1 + q) ** 4.5
            g = np.clip(g - (pull(g, k, h, self.orientation) - force) / (k * np.maximum(slope, 0.05)), -most, most)
        return x + g

    def force(self, x: Any, v: Any, command: Any, p: Mapping[str, Any]) -> Any:
        return pull(command - x, p["magnet_stiffness_N_per_m"], self.height_m, self.orientation)

    def pressing(self, x: Any, command: Any, p: Mapping[str, Any]) -> Any:
        return attraction(command - x, p["magnet_stiffness_N_per_m"], self.height_m, self.orientation)
