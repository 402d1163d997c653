"""A magnet on a carriage outside the body: as a magnetic spring with a finite range, or as one of two dipoles."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from models.drives.drive import Drive, Values
from models.formula import Formula, Line, equal, named, symbols
from models.laws.dipole import PAIRINGS, Orientation, attraction, pull
from models.parameter import Parameter

_STEPS = 4  # of Newton's method on two dipoles


@dataclass(frozen=True)
class Magnetic(Drive):
    """Imposed carriage position in m; force `k g/(1 + (g/r)^2)^2` on the gap g to the capsule, most at `r/sqrt(3)`."""

    name: ClassVar[str] = "magnetic"
    commanded: ClassVar[str] = "carriage_position_m"
    measured: ClassVar[str] = "position_m"
    anchored: ClassVar[bool] = True
    leaves_open: ClassVar[tuple[str, ...]] = ("magnet",)
    stiffness_N_per_m: float = 25.0
    range_m: float = 0.02

    @property
    def gap_limit_m(self) -> float:
        return self.range_m / float(np.sqrt(3))

    def neutral(self, x: Any) -> Any:
        return x

    def parameters(self) -> tuple[Parameter, ...]:
        source = "rig file; several percent off"
        return (Parameter.near("magnet_stiffness_N_per_m", self.stiffness_N_per_m, "N/m", 0.85, 1.15, source),)

    def equations(self, p: Values) -> list[Line]:
        F_act, d, carriage, x = symbols("F_act d u x")
        pull = Formula.of(p["magnet_stiffness_N_per_m"]) * d / (1 + (d / named("r", self.range_m, d)) ** 2) ** 2
        return [[equal(F_act, pull), ", ", equal(d, carriage - x)]]

    def command_for(self, force: Any, x: Any, v: Any, p: Values) -> Any:
        return x + _gap(force / p["magnet_stiffness_N_per_m"], self.range_m)

    def force(self, x: Any, v: Any, command: Any, p: Values) -> Any:
        gap = command - x
        return p["magnet_stiffness_N_per_m"] * gap / (1 + (gap / self.range_m) ** 2) ** 2


def _gap(ratio: Any, reach: float) -> Any:
    """The gap g in m with `g/(1 + (g/r)^2)^2` = `ratio`, up to 0.95 of that of greatest force; three Newton steps."""
    most = 0.95 * reach / np.sqrt(3)
    g = np.clip(ratio, -most, most)
    for _ in range(3):
        q = (g / reach) ** 2
        g = np.clip(g - (g / (1 + q) ** 2 - ratio) * (1 + q) ** 3 / (1 - 3 * q), -most, most)
    return g


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
        source = "rig file: both moments and the height; its fifth power counts"
        return (Parameter.near("magnet_stiffness_N_per_m", self.stiffness_N_per_m, "N/m", 0.7, 1.4, source),)

    def equations(self, p: Values) -> list[Line]:
        pairing, k = PAIRINGS[self.orientation], Formula.of(p["magnet_stiffness_N_per_m"])
        F_act, d, q, carriage, x, N, m, g = symbols("F_act d q u x N m g")
        h = named("h", self.height_m, d)
        falling = (1 + q) ** 3.5
        return [
            [equal(F_act, k * d * (1 - pairing.a * q) / falling)],
            [equal(d, carriage - x), ", ", equal(q, (d / h) ** 2)],
            [equal(N, m * g + k * h * (1 - pairing.c * q) / (pairing.b * falling)), ", with the magnet's attraction"],
        ]

    def command_for(self, force: Any, x: Any, v: Any, p: Values) -> Any:
        """Newton steps, limited to 0.95 of the gap of greatest pull."""
        k, h, pairing = p["magnet_stiffness_N_per_m"], self.height_m, PAIRINGS[self.orientation]
        most = 0.95 * pairing.peak * h
        g = np.clip(force / k, -most, most)
        for _ in range(_STEPS):
            q = (g / h) ** 2
            slope = (1 - 3 * pairing.a * q) / (1 + q) ** 3.5 - 7 * q * (1 - pairing.a * q) / (1 + q) ** 4.5
            g = np.clip(g - (pull(g, k, h, self.orientation) - force) / (k * np.maximum(slope, 0.05)), -most, most)
        return x + g

    def force(self, x: Any, v: Any, command: Any, p: Values) -> Any:
        return pull(command - x, p["magnet_stiffness_N_per_m"], self.height_m, self.orientation)

    def pressing(self, x: Any, command: Any, p: Values) -> Any:
        return attraction(command - x, p["magnet_stiffness_N_per_m"], self.height_m, self.orientation)
