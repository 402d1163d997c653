"""A simulated rig: capsule, tissue, surface, drive, anatomy and hidden effects, advanced in chunks."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from models.laws.geometry import GRAVITY, Capsule, Tissue
from plant import layout as at
from plant.anatomy import Anatomy
from plant.drives import TrueDrive
from plant.hidden.actuation import BEHIND, CARRIAGE_NUMBERS, real_drive
from plant.hidden.registry import ONSET
from plant.hidden.table import begun, effect_table
from plant.steps import advance
from plant.tables import Floats, tabulate

STEP_S = 20e-6  # of the plant


@dataclass(frozen=True)
class TruePlate:
    """A rigid plate: Coulomb friction, static coefficient at least the sliding one (None: equal)."""

    friction_coefficient: float = 0.29
    static_friction_coefficient: float | None = None


@dataclass(frozen=True)
class Truth:
    """All that is true of a rig. `surface` None is the gut of `tissue`; `hoop_factor` scales the hoop stress."""

    drive: TrueDrive
    capsule: Capsule = Capsule()
    tissue: Tissue = Tissue()
    surface: TruePlate | None = None
    hoop_factor: float = 1.0
    anatomy: Anatomy = Anatomy()
    hidden: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    step_s: float = STEP_S


class Plant:
    """The state of a rig and its steps. `advance` takes drive values and returns recorded rows in the columns of
    `plant.layout`. An effect with an onset begins at the nearest step.
    """

    def __init__(self, rig: Truth) -> None:
        if not rig.step_s > 0:
            raise ValueError(f"step_s must be positive; got {rig.step_s:g}")
        self.rig = rig
        self._all = effect_table({name: dict(numbers) for name, numbers in rig.hidden.items()})
        self.effects = begun(self._all, 0.0)
        self._onsets = sorted(float(t) for t in np.unique(self._all[self._all[:, 0] != 0, ONSET]) if t > 0)
        self.tables = tabulate(rig.capsule, rig.tissue)
        self.profile = np.asarray(rig.anatomy.level, dtype=float)
        self.parameters = _parameters(rig)
        self.state = np.zeros(at.S_COUNT)
        self.state[at.S_DIRECTION] = 1.0
        self._carriage = np.zeros(CARRIAGE_NUMBERS)
        self._behind = bool(self.effects[BEHIND, 0].any())

    @property
    def time(self) -> float:
        return float(self.state[at.S_STEP] * self.rig.step_s)

    def stages(self) -> list[tuple[int, Floats]]:
        """The tables of hidden effects in use, each with the step before which it begins, the first with 0."""
        dt = self.rig.step_s
        later = [(max(math.ceil(t / dt - 0.5), 0), begun(self._all, t)) for t in self._onsets]
        return [(0, begun(self._all, 0.0)), *later]

    def advance(self, drive: Floats, every: int = 1) -> Floats:
        """Do `len(drive) - 1` steps with the drive's values at each step's start; the last value only gives the last
        rate. Values are positions in m of a pull or carriage, V of a coil, N or V of an inner mass, the mean of each
        step. Returns a row every `every` steps. Raises `ValueError` for fewer than two values or values not finite.
        """
        values = np.ascontiguousarray(drive, dtype=float)
        if values.ndim != 1 or values.size < 2 or not np.isfinite(values).all():
            raise ValueError(f"drive must be two or more finite values in a row; got shape {values.shape}")
        first, steps = int(self.state[at.S_STEP]), values.size - 1
        begins = {round(t / self.rig.step_s) - first for t in self._onsets}
        parts = [0, *sorted(step for step in begins if 0 < step < steps), steps]
        return np.concatenate([self._advance(values[a : b + 1], every) for a, b in itertools.pairwise(parts)])

    def _advance(self, values: Floats, every: int) -> Floats:
        dt, first, steps = self.rig.step_s, int(self.state[at.S_STEP]), values.size - 1
        now = self.time + 0.5 * dt
        if self._onsets and self._onsets[0] <= now:
            self._onsets = [t for t in self._onsets if t > now]
            self.effects = begun(self._all, now)
            behind = bool(self.effects[BEHIND, 0].any())
            if behind and not self._behind:  # lag and play begin where the drive is
                self._carriage[:] = values[0]
            self._behind = behind
        if self._behind:
            arrived = real_drive(values[:-1], dt, self.effects, self._carriage)
            values = np.append(arrived, real_drive(values[-1:], dt, self.effects, self._carriage.copy()))
        out = np.zeros(((first + steps - 1) // every - (first - 1) // every, at.O_COUNT))
        kind = self.rig.drive.steps(self.effects)
        common = (self.state, self.parameters, self.effects, self.tables, self.profile)
        advance(kind, *common, values, dt, every, out)
        return out


_POSITIVE = (
    *("mass_kg", "radius_m", "cylinder_length_m", "recovery_time_s", "inner_mass_kg", "resistance_ohm"),
    *("current_limit_A", "magnet_range_m", "outer_moment_A_m2", "inner_moment_A_m2", "height_m"),
)
_SIGNED = ("gain", "force", "back_emf", "offset")


def _check(record: object, where: str) -> None:
    """Masses and the like must be positive; all other numbers, except the sign of a force or gain, not negative."""
    for name, value in vars(record).items():
        if not isinstance(value, float | int) or isinstance(value, bool):
            continue
        if not (value > 0 if name in _POSITIVE else value >= 0 or name.startswith(_SIGNED)):
            raise ValueError(
                f"{where}.{name} must be {'positive' if name in _POSITIVE else 'zero or more'}; got {value:g}"
            )


def _parameters(rig: Truth) -> Floats:
    for where in ("capsule", "tissue", "drive", "surface"):
        record = getattr(rig, where)
        if record is not None:
            _check(record, where)
    p, plate = np.zeros(at.P_COUNT), rig.surface
    p[at.P_MASS], p[at.P_WEIGHT] = rig.capsule.mass_kg, (rig.capsule.mass_kg + rig.drive.inner_kg) * GRAVITY
    p[at.P_SURFACE], p[at.P_HOOP] = (at.GUT, rig.hoop_factor) if plate is None else (at.PLATE, 1.0)
    p[at.P_RECOVERY] = rig.tissue.recovery_time_s
    p[at.P_PROFILE_START], p[at.P_PROFILE_STEP] = rig.anatomy.start_m, rig.anatomy.step_m
    p[at.P_MU] = p[at.P_MU_STATIC] = (plate or rig.tissue).friction_coefficient
    static = None if plate is None else plate.static_friction_coefficient
    if static is not None:
        p[at.P_MU_STATIC] = static
        if static < p[at.P_MU]:
            raise ValueError(
                f"static_friction_coefficient must be at least friction_coefficient {p[at.P_MU]:g}; got {static:g}"
            )
    rig.drive.fill(p)
    return p
