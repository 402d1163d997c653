"""A simulated rig: capsule, tissue, surface, drive, anatomy and hidden effects put together, advanced in chunks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from models.laws.geometry import GRAVITY, Capsule, Tissue
from models.laws.resistance import Regime
from plant import layout as at
from plant.anatomy import Anatomy
from plant.drives.body import COIL, FORCE, LINK, MAGNET, advance_body
from plant.drives.pull import advance_pull
from plant.drives.vibro import BY_FORCE, BY_VOLTAGE, advance_vibro
from plant.hidden.carriage import BACKLASH, CARRIAGE_NUMBERS, LAG, real_drive
from plant.hidden.registry import ROWS
from plant.hidden.table import effect_table
from plant.tables import Floats, tabulate

STEP_S = 20e-6


@dataclass(frozen=True)
class Pull:
    """Imposed position; a link of `link_stiffness_N_per_m` (0: rigid) with `link_damping_N_s_per_m`."""

    link_stiffness_N_per_m: float = 0.0
    link_damping_N_s_per_m: float = 0.05


@dataclass(frozen=True)
class Magnet:
    """Carriage magnet: `k g/(1 + (g/r)^2)^2` on the gap g."""

    magnet_stiffness_N_per_m: float = 25.0
    magnet_range_m: float = 0.02


@dataclass(frozen=True)
class Coil:
    """Voltage-driven coil: `L i' = U - R i - K_e v`, `|i|` limited, `F = K i`."""

    gain_N_per_A: float = 0.5
    resistance_ohm: float = 10.0
    inductance_H: float = 10e-3
    current_limit_A: float = 1.0
    back_emf_V_s_per_m: float = 0.5


@dataclass(frozen=True)
class Force:
    """A force in N on the body, nothing else."""


@dataclass(frozen=True)
class Vibro:
    """Inner mass on a spring with damping and stops; driven by force, or by voltage when `coil` is given.

    `reaction_on_body`: the actuator sits on board and pushes back on the body; else a field from outside acts on the
    inner mass alone.
    """

    inner_mass_kg: float = 0.074
    spring_stiffness_N_per_m: float = 256.23
    spring_damping_N_s_per_m: float = 0.0
    force_N: float = 1.25
    reaction_on_body: bool = True
    front_gap_m: float = 1.0
    front_stiffness_N_per_m: float = 0.0
    rear_gap_m: float = 1.0
    rear_stiffness_N_per_m: float = 0.0
    coil: Coil | None = None


Drive = Pull | Magnet | Coil | Force | Vibro


@dataclass(frozen=True)
class Plate:
    """A rigid plate: Coulomb friction, static coefficient at least the sliding one (None: the same)."""

    friction_coefficient: float = 0.29
    static_friction_coefficient: float | None = None


@dataclass(frozen=True)
class Rig:
    """All that is true of a simulated rig. `surface` None is the gut of `tissue`; `hoop_factor` scales the hoop
    stress.
    """

    drive: Drive
    capsule: Capsule = Capsule()
    tissue: Tissue = Tissue()
    surface: Plate | None = None
    hoop_factor: float = 1.0
    anatomy: Anatomy = Anatomy()
    hidden: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    regime: Regime = "low"
    step_s: float = STEP_S


class Plant:
    """The state of a rig and its steps. `advance` takes drive values and returns recorded rows in the columns of
    `plant.layout`.
    """

    def __init__(self, rig: Rig) -> None:
        if not rig.step_s > 0:
            raise ValueError(f"step_s must be positive; got {rig.step_s:g}")
        self.rig = rig
        self.effects = effect_table({name: dict(numbers) for name, numbers in rig.hidden.items()})
        self.tables = tabulate(rig.capsule, rig.tissue, rig.regime)
        self.profile = np.asarray(rig.anatomy.level, dtype=float)
        self.parameters = _parameters(rig)
        self.state = np.zeros(at.S_COUNT)
        self.state[at.S_DIRECTION] = 1.0
        self._carriage = np.zeros(CARRIAGE_NUMBERS)
        self._behind = bool(self.effects[[LAG, BACKLASH], 0].any())

    @property
    def time(self) -> float:
        """Seconds simulated so far."""
        return float(self.state[at.S_STEP] * self.rig.step_s)

    def advance(self, drive: Floats, every: int = 1) -> Floats:
        """Do `len(drive) - 1` steps with the drive's values at each step's start (the last one only gives the last
        rate).

        A pull takes positions in m, a magnet carriage positions in m, a coil voltages in V, a vibro drive forces in N
        or, with a coil, voltages in V, each step's mean. Returns a row each `every` steps. Raises `ValueError` for
        fewer than two values or values that are not finite.
        """
        values = np.ascontiguousarray(drive, dtype=float)
        if values.ndim != 1 or values.size < 2 or not np.isfinite(values).all():
            raise ValueError(f"drive must be two or more finite values in a row; got shape {values.shape}")
        dt, first = self.rig.step_s, int(self.state[at.S_STEP])
        steps = values.size - 1
        if self._behind:
            arrived = real_drive(values[:-1], dt, self.effects, self._carriage)
            values = np.append(arrived, real_drive(values[-1:], dt, self.effects, self._carriage.copy()))
        out = np.zeros(((first + steps - 1) // every - (first - 1) // every, at.O_COUNT))
        common = (self.state, self.parameters, self.effects, self.tables, self.profile, values, dt, every, out)
        kind = self.rig.drive
        if isinstance(kind, Pull):
            elastic = kind.link_stiffness_N_per_m > 0 or self.effects[ROWS["string_compliance"], 0] > 0
            advance_body(LINK, *common) if elastic else advance_pull(*common)
        elif isinstance(kind, Vibro):
            advance_vibro(BY_FORCE if kind.coil is None else BY_VOLTAGE, *common)
        else:
            advance_body(MAGNET if isinstance(kind, Magnet) else COIL if isinstance(kind, Coil) else FORCE, *common)
        return out


_POSITIVE = (
    "mass_kg",
    "radius_m",
    "cylinder_length_m",
    "magnet_range_m",
    "resistance_ohm",
    "current_limit_A",
    "inner_mass_kg",
    "recovery_time_s",
)


def _check(record: object, where: str) -> None:
    """Masses and the like must be positive, all other numbers but a force's or gain's sign not negative."""
    for name, value in vars(record).items():
        if not isinstance(value, float | int) or isinstance(value, bool):
            continue
        if not (value > 0 if name in _POSITIVE else value >= 0 or name.startswith(("gain", "force", "back_emf"))):
            raise ValueError(
                f"{where}.{name} must be {'positive' if name in _POSITIVE else 'zero or more'}; got {value:g}"
            )


def _parameters(rig: Rig) -> Floats:
    for record, where in (
        (rig.capsule, "capsule"),
        (rig.tissue, "tissue"),
        (rig.drive, "drive"),
        (rig.surface, "surface"),
    ):
        if record is not None:
            _check(record, where)
    p = np.zeros(at.P_COUNT)
    total = rig.capsule.mass_kg + (rig.drive.inner_mass_kg if isinstance(rig.drive, Vibro) else 0.0)
    p[at.P_MASS], p[at.P_WEIGHT] = rig.capsule.mass_kg, total * GRAVITY
    p[at.P_HOOP] = rig.hoop_factor if rig.surface is None else 1.0
    p[at.P_RECOVERY] = rig.tissue.recovery_time_s
    p[at.P_PROFILE_START], p[at.P_PROFILE_STEP] = rig.anatomy.start_m, rig.anatomy.step_m
    if rig.surface is None:
        p[at.P_SURFACE], p[at.P_MU] = at.GUT, rig.tissue.friction_coefficient
        p[at.P_MU_STATIC] = p[at.P_MU]
    else:
        static = rig.surface.static_friction_coefficient
        p[at.P_SURFACE], p[at.P_MU] = at.PLATE, rig.surface.friction_coefficient
        p[at.P_MU_STATIC] = p[at.P_MU] if static is None else static
        if p[at.P_MU_STATIC] < p[at.P_MU]:
            raise ValueError(
                f"static_friction_coefficient must be at least friction_coefficient {p[at.P_MU]:g}; got {static:g}"
            )
    _drive_parameters(rig.drive, p)
    return p


def _drive_parameters(drive: Drive, p: Floats) -> None:
    coil = drive.coil if isinstance(drive, Vibro) else drive if isinstance(drive, Coil) else None
    if isinstance(drive, Pull):
        p[at.P_LINK_K], p[at.P_LINK_C] = drive.link_stiffness_N_per_m, drive.link_damping_N_s_per_m
    elif isinstance(drive, Magnet):
        p[at.P_MAGNET_K], p[at.P_MAGNET_RANGE] = drive.magnet_stiffness_N_per_m, drive.magnet_range_m
    elif isinstance(drive, Vibro):
        p[at.P_INNER_MASS], p[at.P_SPRING_K] = drive.inner_mass_kg, drive.spring_stiffness_N_per_m
        p[at.P_SPRING_C], p[at.P_REACTION] = drive.spring_damping_N_s_per_m, float(drive.reaction_on_body)
        p[at.P_FRONT_GAP], p[at.P_FRONT_K] = drive.front_gap_m, drive.front_stiffness_N_per_m
        p[at.P_REAR_GAP], p[at.P_REAR_K] = drive.rear_gap_m, drive.rear_stiffness_N_per_m
    if coil is not None:
        p[at.P_COIL_GAIN], p[at.P_COIL_R], p[at.P_COIL_L] = coil.gain_N_per_A, coil.resistance_ohm, coil.inductance_H
        p[at.P_COIL_LIMIT], p[at.P_COIL_EMF] = coil.current_limit_A, coil.back_emf_V_s_per_m
