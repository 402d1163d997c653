"""A table of steady friction over speed and load: `F = mu (N + normal loads) sgn(v) level - forces`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import mul
from typing import Final

import numpy as np

from models.effects import CATALOGUE, Catalogue
from models.effects.effect import Effect, Signals
from models.identification.kind import Array, Split, present
from models.identification.kinds.ranges import Ranges, ranged
from models.identification.kinds.table import TableKind, distinct, left_out_in_turn, means
from models.identification.settings import SET
from models.parameter import Parameter
from models.records.record import Record
from models.rigs.benches import FRICTION
from models.rigs.rig import Rig
from models.theta import Theta
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
FORCE, COEFFICIENT, SPEED, LOAD = "force_N", "friction_coefficient", "velocity_m_s", "load_N"
_BELIEF = "rig file; without it only a start for the calibration"


@dataclass(frozen=True)
class FrictionKind(TableKind):
    """Steady sliding, a condition is a speed and a load.

    The base is one number: the coefficient of friction where the load is known (a column `load_N`, or `[contact]
    load_N`) or a coefficient was measured, else the friction force, positive for a positive speed. A coefficient
    without a load counts as the force under 1 N. `std` is a reading's standard deviation in the measured unit,
    `relative` its share of the reading.
    """

    base: tuple[Parameter, ...]
    quantity: str = FORCE
    load: float | None = None
    std: float | None = None
    relative: float = SET.friction_scatter
    extent: Extent | None = None
    effects: tuple[type[Effect], ...] = field(default_factory=lambda: candidates(None))
    name: str = FRICTION.id
    catalogue: Catalogue = CATALOGUE
    measure: str = "rms error of the friction over the conditions, each the mean of its repeats"

    @classmethod
    def from_rig(cls, rig: Rig, records: Sequence[Record] = ()) -> FrictionKind:
        """The contact of a rig file's `[contact]`; what that leaves out, and all ranges, follow from the records.
        Raises ValueError where some records have a coefficient or a load and some not.
        """
        known = [r for r in records if FORCE in r.columns or COEFFICIENT in r.columns]
        coefficient = any(COEFFICIENT in r.columns for r in known)
        if len({(COEFFICIENT in r.columns, LOAD in r.columns) for r in records if r in known}) > 1:
            names, got = ", ".join(r.name for r in known), f"some with {COEFFICIENT!r} or {LOAD!r} and some without"
            raise ValueError(f"{names}: records of one series must have the same columns; got {got}")
        quantity, load, catalogue = COEFFICIENT if coefficient else FORCE, rig.contact.load_N, Catalogue.of(rig)
        loaded = coefficient or load is not None or any(LOAD in r.columns for r in records)
        size, scatter, extent = 1.0, SET.friction_scatter, None
        if known:
            v, loads = np.concatenate([r[SPEED] for r in known]), np.concatenate([_loads(r, load) for r in known])
            read = np.abs(np.concatenate([r[quantity] for r in known]))
            size = float(np.median(read / (1 if coefficient else loads)))
            extent = Extent.of(v, loads, read * (loads if coefficient else 1.0))
            scatter = _scatter(known, quantity)
        stated = rig.contact.friction_coefficient if loaded else rig.contact.friction_N
        value = stated if stated is not None else (size if known else 0.1 if loaded else 1.0)
        name, unit = ("friction_coefficient", "1") if loaded else ("friction_N", "N")
        base = Parameter(name, value, unit, 0.0, 10 * max(value, size), _BELIEF, fit=True)
        std = None if coefficient else rig.noise.force_std_N
        effects = candidates(extent, catalogue)
        return cls((base,), quantity, load, std, scatter, extent, effects, catalogue=catalogue)

    @property
    def unit(self) -> str:
        return "N" if self.quantity == FORCE else "1"

    def keys(self, record: Record) -> Array:
        """Speeds in m/s and loads in N."""
        return np.column_stack((record[SPEED], _loads(record, self.load)))

    def predict(self, record: Record, theta: Theta) -> Array:
        """Force in N along the sliding that it drives, or its ratio to the load; one value a row."""
        values = self.nominal() | theta
        v, load = record[SPEED], _loads(record, self.load)
        direction = np.sign(v)
        s = Signals(v=v, direction=direction, load=load)
        acting = present(self.effects, values)
        level = reduce(mul, (effect.level(s, p, {}) for effect, p in acting), 1.0)
        extra = sum(effect.force(s, p, {}) for effect, p in acting)
        pressed = load + sum(effect.normal_load(s, p, {}) for effect, p in acting)
        grip = values["friction_N"] if "friction_N" in values else values["friction_coefficient"] * pressed
        force = grip * level * direction - extra
        return np.asarray((force if self.quantity == FORCE else force * direction / load) + 0.0 * v, dtype=float)

    def residual(self, record: Record, theta: Theta, criterion: int = 0) -> Array:
        """Difference of each condition's mean from the model in standard deviations."""
        return self.errors(record, self.predict(record, theta)) / np.sqrt(self.variances(record))

    def scatter(self, record: Record) -> Array:
        """As stated, else a share of the condition's mean."""
        if self.std is not None:
            return np.full(len(record), self.std)
        mean = self.means(record, record[self.quantity])[self.conditions(record)[1]]
        return np.maximum(self.relative * np.abs(mean), 1e-12)

    def imitate(self, record: Record, theta: Theta, rng: np.random.Generator) -> Record:
        """The same readings on the model, each with the assumed scatter."""
        noise = self.scatter(record) * rng.standard_normal(len(record))
        return record.with_column(self.quantity, self.predict(record, theta) + noise)

    def splits(self, records: Sequence[Record]) -> list[Split]:
        """Up to eight random parts of conditions; the only one at an end of speed or load is always fitted to."""
        runs, index = distinct(np.concatenate([self.keys(r) for r in records]))
        alone = np.zeros(len(runs), dtype=bool)
        for size in np.abs(runs).T:
            for at in (size == size.min(), size == size.max()):
                alone |= at & (at.sum() == 1) & (np.ptp(size) > 0)
        inner = np.flatnonzero(~alone) if np.sum(~alone) >= 2 else np.arange(len(runs))
        part = np.full(len(runs), -1)
        part[inner] = np.random.default_rng(0).permutation(len(inner)) % min(SET.folds, len(inner))
        return left_out_in_turn(records, index, part)

    def signals(self, record: Record) -> dict[str, Array]:
        return {name: record[name] for name in (SPEED, LOAD) if name in record.columns}

    def columns(self, record: Record, predicted: Array) -> dict[str, Array]:
        return {**self.signals(record), self.quantity: predicted}


def _loads(record: Record, load: float | None) -> Array:
    return record[LOAD] if LOAD in record.columns else np.full(len(record), 1.0 if load is None else load)


def _scatter(records: Sequence[Record], quantity: str) -> float:
    """Relative scatter of a reading: of repeats, else of the distance from the line through its neighbours."""
    squares, freedom, off = 0.0, 0, list[Array]()
    for r in records:
        runs, index = distinct(np.column_stack((r[SPEED], _loads(r, None))))
        mean = means(index, r[quantity])
        usable = mean[index] != 0
        squares += float(np.sum((r[quantity][usable] / mean[index][usable] - 1) ** 2))
        freedom += len(r) - len(runs)
        for key in np.unique(np.column_stack((np.sign(runs[:, 0]), runs[:, 1])), axis=0):
            own = (np.sign(runs[:, 0]) == key[0]) & (runs[:, 1] == key[1])
            if np.sum(own) > 3:
                off.append(_off_line(np.log(np.abs(runs[own, 0])), mean[own]))
    found = SET.friction_scatter
    if freedom >= 3:
        found = np.sqrt(squares / freedom)
    elif off:
        found = 1.4826 * np.median(np.abs(np.concatenate(off)))
    return float(max(found, SET.friction_finest))


def _off_line(x: Array, y: Array) -> Array:
    """Relative distance of inner values from their neighbours' line, scaled to the standard deviation of a reading."""
    order = np.argsort(x)
    x, y = x[order], y[order]
    right = (x[1:-1] - x[:-2]) / (x[2:] - x[:-2])
    size = np.sqrt(1 + right**2 + (1 - right) ** 2)
    return np.asarray((y[1:-1] - (1 - right) * y[:-2] - right * y[2:]) / (size * np.abs(y[1:-1])), dtype=float)


@dataclass(frozen=True)
class Extent:
    """Slowest and fastest speed in m/s, lowest and highest load, greatest friction in N, one or both directions."""

    slow: float
    fast: float
    light: float
    heavy: float
    friction: float
    both_ways: bool

    @classmethod
    def of(cls, v: Array, load: Array, force: Array) -> Extent:
        fast, both = np.abs(v), bool((v > 0).any() and (v < 0).any())
        slow, quick, light, heavy = (float(end) for end in (fast.min(), fast.max(), load.min(), load.max()))
        return cls(slow, quick, light, heavy, float(np.abs(force).max()), both)

    @property
    def lacks(self) -> Mapping[str, str]:
        """Conditions that these records lack, by the name that an effect gives them in `needs`."""
        ratio = SET.friction_ratio
        covered = {
            "speeds": (self.fast > ratio * self.slow, TEXT("speeds_alike", low=self.slow, high=self.fast)),
            "load": (self.heavy > ratio * self.light, TEXT("loads_alike", low=self.light, high=self.heavy)),
            "both_ways": (self.both_ways, TEXT("one_way")),
        }
        return {name: words for name, (there, words) in covered.items() if not there}


def candidates(extent: Extent | None, catalogue: Catalogue = CATALOGUE) -> tuple[type[Effect], ...]:
    """The effects that a search tries on a table of this extent; all, as declared, where it is unknown."""
    declared = catalogue.acting_on(FRICTION.id)
    if extent is None:
        return declared
    own, lacks = _ranges(extent), extent.lacks.keys()
    return tuple(_ranged(e, own.get(e.id, Ranges())) for e in declared if not lacks & set(e.needs))


def cannot_show(extent: Extent, catalogue: Catalogue) -> dict[str, str]:
    """Why a table of this extent cannot show an effect, by effect."""
    lacks = extent.lacks
    why = {e.id: "; ".join(lacks[need] for need in e.needs if need in lacks) for e in catalogue.acting_on(FRICTION.id)}
    return {name: words for name, words in why.items() if words}


def _ranges(x: Extent) -> Mapping[str, Ranges]:
    drag = 3 * x.friction * max(1.0, SET.drag_reference_m_s / x.fast) ** SET.drag_steepest
    return {
        "stribeck": Ranges(
            {"excess": (0.0, 0.0, 10.0), "speed_m_s": (float(np.sqrt(x.slow * x.fast)), 0.3 * x.slow, 3 * x.fast)},
            {"speed_m_s": tuple(float(v) for v in np.geomspace(x.slow, x.fast, 5))},
        ),
        "viscous_drag": Ranges(
            {"coefficient_N": (0.0, 0.0, drag), "exponent": (0.5, 0.1, SET.drag_steepest)},
            {"exponent": (0.2, 0.5, 1.0, 2.0)},
        ),
        "load_dependent_friction": Ranges({"growth_per_load": (0.0, -0.95 / x.heavy, 20 / x.heavy)}),
        "hertzian_contact": Ranges({"reference_N": (float(np.sqrt(x.light * x.heavy)), 1e-6, 1e9)}),
        "adhesive_contact": Ranges({"load_N": (0.0, -0.9 * x.light, 5 * x.heavy)}),
    }


def _ranged(effect: type[Effect], own: Ranges) -> type[Effect]:
    size = effect.amplitude()
    most = own.of[size.name][2] if size.name in own.of else size.upper
    return ranged(effect, replace(own, probe=min(effect.probe, 0.05 * most)))
