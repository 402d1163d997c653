"""The simulated drives: true numbers, compiled steps, feedback and recorded columns; one class per kind, one table."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, Final

import numpy as np

from plant import layout as at
from plant import steps
from plant.hidden.registry import AXIS, COIL, MAGNETIC, PULL, ROW, VIBRO
from plant.tables import Floats


def _at(place: int, default: float) -> Any:
    return field(default=default, metadata={"place": place})


@dataclass(frozen=True)
class TrueDrive(ABC):
    """A drive's true numbers; `kind` is that of its rig.

    - `free`: the capsule can be controlled in closed loop. `straight`: a new command is approached in a straight line,
      else held. `pushes`: it puts a force on the body that a limit applies to.
    - `measured`: the plant's column that a record measures, `reports`: the column of its own feedback, `recorded`: see
      `columns`.
    - `unit`: that of the measured column, as keys have it.
    - `calibrated`: the names in a calibration of its force and spring. `step`: its compiled step.
    """

    kind: ClassVar[str] = ""
    step: ClassVar[int]
    reports: ClassVar[str] = ""
    recorded: ClassVar[dict[str, str]] = {}
    free: ClassVar[bool] = False
    straight: ClassVar[bool] = False
    pushes: ClassVar[bool] = True
    measured: ClassVar[int] = at.O_X
    unit: ClassVar[tuple[str, str]] = ("position", "m")
    calibrated: ClassVar[dict[str, str]] = {}

    @property
    def feedback(self) -> str:
        return self.reports

    @property
    def inner_kg(self) -> float:
        return 0.0

    @property
    def command_scale(self) -> float:
        """A command of 1 in the unit of the plant."""
        return 1.0

    def steps(self, effects: Floats) -> int:
        return self.step

    def columns(self) -> dict[str, str]:
        """The columns of a record beside time: what is `commanded` at each sample, its `mean` since the last one, the
        sensor's `reading`, the coil's `current`.
        """
        return self.recorded

    def fill(self, p: Floats) -> None:
        for own in fields(self):
            value = getattr(self, own.name)
            if isinstance(value, TrueDrive):
                value.fill(p)
            elif "place" in own.metadata:
                p[own.metadata["place"]] = value

    def varied(self, *factors: float) -> TrueDrive:
        """The same drive with force and spring multiplied by `factors`."""
        new = {own: getattr(self, own) * f for own, f in zip(self.calibrated.values(), factors, strict=False)}
        return replace(self, **new)


@dataclass(frozen=True)
class TruePull(TrueDrive):
    """Imposed position; a link of `link_stiffness_N_per_m` (0: rigid) with `link_damping_N_s_per_m`."""

    kind: ClassVar[str] = PULL
    measured: ClassVar[int] = at.O_FORCE
    unit: ClassVar[tuple[str, str]] = ("force", "N")
    recorded: ClassVar[dict[str, str]] = {"position_m": "commanded", "force_N": "reading"}
    link_stiffness_N_per_m: float = _at(at.P_LINK_K, 0.0)
    link_damping_N_s_per_m: float = _at(at.P_LINK_C, 0.05)

    def steps(self, effects: Floats) -> int:
        elastic = self.link_stiffness_N_per_m > 0 or effects[ROW.string_compliance, 0] > 0
        return steps.LINK if elastic else steps.PULL


@dataclass(frozen=True)
class Carriage(TrueDrive):
    kind: ClassVar[str] = MAGNETIC
    free: ClassVar[bool] = True
    straight: ClassVar[bool] = True
    reports: ClassVar[str] = "carriage_position_m"
    recorded: ClassVar[dict[str, str]] = {"carriage_position_m": "commanded", "position_m": "reading"}

    @property
    @abstractmethod
    def gap_limit_m(self) -> float:
        """The gap in m of the greatest pull."""


@dataclass(frozen=True)
class TrueMagnet(Carriage):
    """Carriage magnet: `k g/(1 + (g/r)^2)^2` on the gap g."""

    step: ClassVar[int] = steps.MAGNET
    calibrated: ClassVar[dict[str, str]] = {"magnet_stiffness_N_per_m": "magnet_stiffness_N_per_m"}
    magnet_stiffness_N_per_m: float = _at(at.P_MAGNET_K, 25.0)
    magnet_range_m: float = _at(at.P_MAGNET_RANGE, 0.02)

    @property
    def gap_limit_m(self) -> float:
        return self.magnet_range_m / math.sqrt(3)


@dataclass(frozen=True)
class TrueMagnetPair(Carriage):
    """Carriage magnet and capsule magnet as two dipoles at a height across the lumen; their attraction presses the
    capsule on its surface. `along`: opposite moments along the lumen, else across it.
    """

    step: ClassVar[int] = steps.PAIR
    outer_moment_A_m2: float = _at(at.P_OUTER_MOMENT, 400.0)
    inner_moment_A_m2: float = _at(at.P_INNER_MOMENT, 1.0)
    height_m: float = _at(at.P_MAGNET_HEIGHT, 0.15)
    along: bool = _at(at.P_MAGNET_ALONG, False)

    def forces(self, gap_m: Floats) -> tuple[Floats, Floats]:
        """Pull along the lumen and attraction across it in N at the gaps (n,)."""
        p, s = np.zeros(at.P_COUNT), np.zeros(at.S_COUNT)
        self.fill(p)
        pairs = [(steps.pair_force(gap, s, p), s[at.S_PRESSING]) for gap in gap_m.tolist()]
        return np.array([pull for pull, _ in pairs]), np.array([press for _, press in pairs])

    @property
    def gap_limit_m(self) -> float:
        gaps = np.linspace(0.0, self.height_m, 2001)
        return float(gaps[np.argmax(self.forces(gaps)[0])])


@dataclass(frozen=True)
class TrueCoil(TrueDrive):
    """Voltage-driven coil: `L i' = U - R i - K_e v`, `|i|` limited, `F = K i`."""

    kind: ClassVar[str] = COIL
    step: ClassVar[int] = steps.COIL
    reports: ClassVar[str] = "coil_current_A"
    free: ClassVar[bool] = True
    calibrated: ClassVar[dict[str, str]] = {"coil_force_N_per_A": "gain_N_per_A"}
    recorded: ClassVar[dict[str, str]] = {
        "coil_current_A": "current",
        "position_m": "reading",
        "coil_voltage_V": "commanded",
    }
    gain_N_per_A: float = _at(at.P_COIL_GAIN, 0.5)
    resistance_ohm: float = _at(at.P_COIL_R, 10.0)
    inductance_H: float = _at(at.P_COIL_L, 10e-3)
    current_limit_A: float = _at(at.P_COIL_LIMIT, 1.0)
    back_emf_V_s_per_m: float = _at(at.P_COIL_EMF, 0.5)


@dataclass(frozen=True)
class TrueVibro(TrueDrive):
    """Inner mass on a spring with damping and stops, driven by force, or by voltage with `coil`. `reaction_on_body`:
    the actuator is on board and pushes back on the body; else an external field acts on the inner mass alone.
    """

    kind: ClassVar[str] = VIBRO
    free: ClassVar[bool] = True
    pushes: ClassVar[bool] = False
    calibrated: ClassVar[dict[str, str]] = {name: name for name in ("force_N", "spring_stiffness_N_per_m")}
    recorded: ClassVar[dict[str, str]] = {"drive_on": "mean", "position_m": "reading"}
    inner_mass_kg: float = _at(at.P_INNER_MASS, 0.074)
    spring_stiffness_N_per_m: float = _at(at.P_SPRING_K, 256.23)
    spring_damping_N_s_per_m: float = _at(at.P_SPRING_C, 0.0)
    force_N: float = 1.25
    reaction_on_body: bool = _at(at.P_REACTION, True)
    front_gap_m: float = _at(at.P_FRONT_GAP, 1.0)
    front_stiffness_N_per_m: float = _at(at.P_FRONT_K, 0.0)
    rear_gap_m: float = _at(at.P_REAR_GAP, 1.0)
    rear_stiffness_N_per_m: float = _at(at.P_REAR_K, 0.0)
    coil: TrueCoil | None = None

    @property
    def feedback(self) -> str:
        return "" if self.coil is None else self.coil.reports

    @property
    def inner_kg(self) -> float:
        return self.inner_mass_kg

    @property
    def command_scale(self) -> float:
        return self.force_N if self.coil is None else 1.0

    def steps(self, effects: Floats) -> int:
        return steps.INNER_FORCE if self.coil is None else steps.INNER_VOLTAGE

    def columns(self) -> dict[str, str]:
        if self.coil is None:
            return self.recorded
        return {"coil_voltage_V": "mean", "position_m": "reading", "coil_current_A": "current"}


@dataclass(frozen=True)
class TrueAxis(TrueDrive):
    """A stage on bearings, `F = m a + (F_c + F_v |v|) Sgn(v) + offset`, whose place is imposed; the plant's mass and
    plate have m and F_c. What turns has rad, N m and kg m2 for m, N and kg.
    """

    kind: ClassVar[str] = AXIS
    step: ClassVar[int] = steps.PULL
    measured: ClassVar[int] = at.O_FORCE
    unit: ClassVar[tuple[str, str]] = ("force", "N")
    recorded: ClassVar[dict[str, str]] = {"position_m": "commanded", "force_N": "reading"}
    viscous_N_s_per_m: float = _at(at.P_VISCOUS, 0.0)
    offset_N: float = _at(at.P_OFFSET, 0.0)


class TurningAxis(TrueAxis):
    unit: ClassVar[tuple[str, str]] = ("torque", "N_m")
    recorded: ClassVar[dict[str, str]] = {"angle_rad": "commanded", "torque_N_m": "reading"}


class ForcedAxis(TrueAxis):
    """The same, pushed by a force."""

    step: ClassVar[int] = steps.FORCE
    measured: ClassVar[int] = at.O_X
    unit: ClassVar[tuple[str, str]] = ("position", "m")
    recorded: ClassVar[dict[str, str]] = {"force_N": "commanded", "position_m": "reading"}


class TurnedAxis(ForcedAxis):
    unit: ClassVar[tuple[str, str]] = ("angle", "rad")
    recorded: ClassVar[dict[str, str]] = {"torque_N_m": "commanded", "angle_rad": "reading"}


DRIVES: Final[dict[str, type[TrueDrive]]] = {
    drive.kind: drive for drive in (TruePull, TrueMagnet, TrueCoil, TrueVibro, TrueAxis)
}
"""The drives of scenarios, by the kind of rig."""
