"""The simulated drives: what is true of each, how it advances, what it feeds back. One class a kind, one table."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import numpy as np

from plant import layout as at
from plant.drives.body import COIL, FORCE, LINK, MAGNET, PAIR, advance_body, pair_force
from plant.drives.pull import advance_pull
from plant.drives.vibro import BY_FORCE, BY_VOLTAGE, advance_vibro
from plant.hidden import registry
from plant.tables import Floats


@dataclass(frozen=True)
class TrueDrive(ABC):
    """A drive's true numbers; `kind` is that of its rig. `free`: the capsule can be led in closed loop; `straight`: a
    command is gone to in a straight line, else it is held; `feedback` is the column that the drive itself reports, ""
    for none; `pushes`: it puts a force on the body that a limit applies to.
    """

    kind: ClassVar[str] = ""
    free: ClassVar[bool] = False
    straight: ClassVar[bool] = False
    pushes: ClassVar[bool] = True
    measured: ClassVar[int] = at.O_X

    @property
    def feedback(self) -> str:
        """The column of the drive's feedback; empty where it has none."""
        return ""

    @property
    def inner_kg(self) -> float:
        """Mass in kg that the body carries."""
        return 0.0

    @property
    def command_scale(self) -> float:
        """What a command of 1 is in the unit that the plant takes."""
        return 1.0

    @abstractmethod
    def loop(self, effects: Floats) -> tuple[Any, tuple[int, ...]]:
        """The compiled loop that does this drive's steps under the hidden `effects`, and its first arguments."""

    def advance(self, effects: Floats, common: tuple[Any, ...]) -> None:
        """Do the steps of `common`, the arrays that `Plant.advance` hands to the compiled loops."""
        function, kind = self.loop(effects)
        function(*kind, *common)

    @abstractmethod
    def fill(self, p: Floats) -> None:
        """Write the drive's numbers into the plant's parameters `p`."""

    def columns(self, commanded: Floats, mean: Floats, reading: Floats, current: Floats) -> dict[str, Floats]:
        """The columns of a record beside time: `commanded` at each sample, its `mean` since the last one, the sensor's
        `reading`, the coil's `current`.
        """
        raise NotImplementedError(f"a {type(self).__name__.lower()} has no record")

    def numbers(self) -> dict[str, float]:
        """The true numbers under the names that a calibration gives them."""
        return {}

    def varied(self, force: float, spring: float) -> TrueDrive:
        """The same drive with its force and its spring by these factors other."""
        return self


@dataclass(frozen=True)
class TruePull(TrueDrive):
    """Imposed position; a link of `link_stiffness_N_per_m` (0: rigid) with `link_damping_N_s_per_m`."""

    kind: ClassVar[str] = registry.PULL
    measured: ClassVar[int] = at.O_FORCE
    link_stiffness_N_per_m: float = 0.0
    link_damping_N_s_per_m: float = 0.05

    def loop(self, effects: Floats) -> tuple[Any, tuple[int, ...]]:
        elastic = self.link_stiffness_N_per_m > 0 or effects[registry.ROWS["string_compliance"], 0] > 0
        return (advance_body, (LINK,)) if elastic else (advance_pull, ())

    def fill(self, p: Floats) -> None:
        p[at.P_LINK_K], p[at.P_LINK_C] = self.link_stiffness_N_per_m, self.link_damping_N_s_per_m

    def columns(self, commanded: Floats, mean: Floats, reading: Floats, current: Floats) -> dict[str, Floats]:
        return {"position_m": commanded, "force_N": reading}


@dataclass(frozen=True)
class Carriage(TrueDrive):
    """A magnet on a carriage."""

    kind: ClassVar[str] = registry.MAGNETIC
    free: ClassVar[bool] = True
    straight: ClassVar[bool] = True

    @property
    def feedback(self) -> str:
        return "carriage_position_m"

    def columns(self, commanded: Floats, mean: Floats, reading: Floats, current: Floats) -> dict[str, Floats]:
        return {"carriage_position_m": commanded, "position_m": reading}

    @property
    @abstractmethod
    def gap_limit_m(self) -> float:
        """The gap in m at which the magnet pulls most."""


@dataclass(frozen=True)
class TrueMagnet(Carriage):
    """Carriage magnet: `k g/(1 + (g/r)^2)^2` on the gap g."""

    magnet_stiffness_N_per_m: float = 25.0
    magnet_range_m: float = 0.02

    def loop(self, effects: Floats) -> tuple[Any, tuple[int, ...]]:
        return advance_body, (MAGNET,)

    def fill(self, p: Floats) -> None:
        p[at.P_MAGNET_K], p[at.P_MAGNET_RANGE] = self.magnet_stiffness_N_per_m, self.magnet_range_m

    def numbers(self) -> dict[str, float]:
        return {"magnet_stiffness_N_per_m": self.magnet_stiffness_N_per_m}

    def varied(self, force: float, spring: float) -> TrueDrive:
        return replace(self, magnet_stiffness_N_per_m=self.magnet_stiffness_N_per_m * force)

    @property
    def gap_limit_m(self) -> float:
        return self.magnet_range_m / math.sqrt(3)


@dataclass(frozen=True)
class TrueMagnetPair(Carriage):
    """A carriage magnet and the capsule's as two dipoles at a height across the lumen, whose attraction presses the
    capsule on its surface. `along`: the moments lie along the lumen, opposite to each other, else across it.
    """

    outer_moment_A_m2: float = 400.0
    inner_moment_A_m2: float = 1.0
    height_m: float = 0.15
    along: bool = False

    def loop(self, effects: Floats) -> tuple[Any, tuple[int, ...]]:
        return advance_body, (PAIR,)

    def fill(self, p: Floats) -> None:
        p[at.P_OUTER_MOMENT], p[at.P_INNER_MOMENT] = self.outer_moment_A_m2, self.inner_moment_A_m2
        p[at.P_MAGNET_HEIGHT], p[at.P_MAGNET_ALONG] = self.height_m, float(self.along)

    def forces(self, gap_m: Floats) -> tuple[Floats, Floats]:
        """Pull along the lumen and attraction across it in N at the gaps (n,)."""
        p, s = np.zeros(at.P_COUNT), np.zeros(at.S_COUNT)
        self.fill(p)
        pairs = [(pair_force(gap, s, p), s[at.S_PRESSING]) for gap in gap_m.tolist()]
        return np.array([pull for pull, _ in pairs]), np.array([press for _, press in pairs])

    @property
    def gap_limit_m(self) -> float:
        gaps = np.linspace(0.0, self.height_m, 2001)
        return float(gaps[np.argmax(self.forces(gaps)[0])])

    def numbers(self) -> dict[str, float]:
        small = 1e-4 * self.height_m
        return {"magnet_stiffness_N_per_m": float(self.forces(np.array([small]))[0][0]) / small}


@dataclass(frozen=True)
class TrueCoil(TrueDrive):
    """Voltage-driven coil: `L i' = U - R i - K_e v`, `|i|` limited, `F = K i`."""

    kind: ClassVar[str] = registry.COIL
    free: ClassVar[bool] = True
    gain_N_per_A: float = 0.5
    resistance_ohm: float = 10.0
    inductance_H: float = 10e-3
    current_limit_A: float = 1.0
    back_emf_V_s_per_m: float = 0.5

    @property
    def feedback(self) -> str:
        return "coil_current_A"

    def loop(self, effects: Floats) -> tuple[Any, tuple[int, ...]]:
        return advance_body, (COIL,)

    def fill(self, p: Floats) -> None:
        p[at.P_COIL_GAIN], p[at.P_COIL_R], p[at.P_COIL_L] = self.gain_N_per_A, self.resistance_ohm, self.inductance_H
        p[at.P_COIL_LIMIT], p[at.P_COIL_EMF] = self.current_limit_A, self.back_emf_V_s_per_m

    def columns(self, commanded: Floats, mean: Floats, reading: Floats, current: Floats) -> dict[str, Floats]:
        return {"coil_current_A": current, "position_m": reading, "coil_voltage_V": commanded}

    def numbers(self) -> dict[str, float]:
        return {"coil_force_N_per_A": self.gain_N_per_A}

    def varied(self, force: float, spring: float) -> TrueDrive:
        return replace(self, gain_N_per_A=self.gain_N_per_A * force)


@dataclass(frozen=True)
class Force(TrueDrive):
    """A force in N on the body, nothing else."""

    kind: ClassVar[str] = registry.FORCE

    def loop(self, effects: Floats) -> tuple[Any, tuple[int, ...]]:
        return advance_body, (FORCE,)

    def fill(self, p: Floats) -> None:
        return


@dataclass(frozen=True)
class TrueVibro(TrueDrive):
    """Inner mass on a spring with damping and stops; driven by force, or by voltage when `coil` is given.

    `reaction_on_body`: the actuator sits on board and pushes back on the body; else a field from outside acts on the
    inner mass alone.
    """

    kind: ClassVar[str] = registry.VIBRO
    free: ClassVar[bool] = True
    pushes: ClassVar[bool] = False
    inner_mass_kg: float = 0.074
    spring_stiffness_N_per_m: float = 256.23
    spring_damping_N_s_per_m: float = 0.0
    force_N: float = 1.25
    reaction_on_body: bool = True
    front_gap_m: float = 1.0
    front_stiffness_N_per_m: float = 0.0
    rear_gap_m: float = 1.0
    rear_stiffness_N_per_m: float = 0.0
    coil: TrueCoil | None = None

    @property
    def feedback(self) -> str:
        return "" if self.coil is None else "coil_current_A"

    @property
    def inner_kg(self) -> float:
        return self.inner_mass_kg

    @property
    def command_scale(self) -> float:
        return self.force_N if self.coil is None else 1.0

    def loop(self, effects: Floats) -> tuple[Any, tuple[int, ...]]:
        return advance_vibro, (BY_FORCE if self.coil is None else BY_VOLTAGE,)

    def fill(self, p: Floats) -> None:
        p[at.P_INNER_MASS], p[at.P_SPRING_K] = self.inner_mass_kg, self.spring_stiffness_N_per_m
        p[at.P_SPRING_C], p[at.P_REACTION] = self.spring_damping_N_s_per_m, float(self.reaction_on_body)
        p[at.P_FRONT_GAP], p[at.P_FRONT_K] = self.front_gap_m, self.front_stiffness_N_per_m
        p[at.P_REAR_GAP], p[at.P_REAR_K] = self.rear_gap_m, self.rear_stiffness_N_per_m
        if self.coil is not None:
            self.coil.fill(p)

    def columns(self, commanded: Floats, mean: Floats, reading: Floats, current: Floats) -> dict[str, Floats]:
        if self.coil is not None:
            return {"coil_voltage_V": mean, "position_m": reading, "coil_current_A": current}
        return {"drive_on": mean, "position_m": reading}

    def numbers(self) -> dict[str, float]:
        return {"force_N": self.force_N, "spring_stiffness_N_per_m": self.spring_stiffness_N_per_m}

    def varied(self, force: float, spring: float) -> TrueDrive:
        stiffness = self.spring_stiffness_N_per_m * spring
        return replace(self, force_N=self.force_N * force, spring_stiffness_N_per_m=stiffness)


DRIVES: Final[dict[str, type[TrueDrive]]] = {drive.kind: drive for drive in (TruePull, TrueMagnet, TrueCoil, TrueVibro)}
"""The drives that a scenario can name, by the kind of rig."""
