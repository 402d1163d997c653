"""A linear stage or an axis that turns: `F = M a + (F_v v + F_c sgn v) level + offset - effects` of its motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from types import MappingProxyType
from typing import Any, ClassVar, TypeVar

import numpy as np

from models.checks.usable import used
from models.effects import CATALOGUE, REFINEMENTS, Catalogue
from models.effects.effect import Effect, Signals
from models.identification.kind import Array, Kind, Split, present
from models.identification.kinds.axis.along import LANES, force_along, rows_of
from models.identification.kinds.axis.coordinates import LINE, TURN, Coordinates, coordinates_of
from models.identification.kinds.axis.effects import Size, candidates
from models.identification.kinds.axis.logged import logged_in
from models.identification.kinds.axis.moved import (
    AxisNoise,
    Moved,
    band_of,
    filtered_noise,
    inertia_of,
    moved,
    through,
    white_part,
)
from models.identification.kinds.axis.zero_phase import decimate, evened, motion, passed, repeat_lag, sampling_rate
from models.identification.kinds.conditions import may_be_left_out
from models.identification.kinds.ranges import Range
from models.identification.settings import SET
from models.parameter import Parameter
from models.records.record import Record
from models.rigs.benches import AXIS
from models.rigs.columns import LOADS
from models.rigs.rig import Rig
from models.theta import Theta

T = TypeVar("T")
Cut = Callable[[Record, int, int], Record]
"""The part of a record from a row up to another."""
_BLOCKS = 4  # of a record's cycle of motion, of which each is left out once
_BELIEF = "rig file; without it only a start for the calibration"


@dataclass(frozen=True)
class AxisKind(Kind):
    """The inverse dynamics of a stage from its measured position, filtered as the EMPS authors do, in a narrower `band`
    (Hz) where the position is noisier than theirs; also of an axis that turns, with angles, torques and inertia.

    An effect's `level` multiplies the friction, of the viscous part as far as `level_on_viscous` has it; its `force`
    acts on the stage along +x, its `delay` is the time by which the position is read late. `force_std` and
    `position_std` are the noise before the filter; without the first it is estimated from repeats of the motion, else
    from the white part of the force, and is `usual_std` in a record that does not show it beside others that do. Rows
    at rest do not count, since friction there takes any value up to its limit.
    """

    base: tuple[Parameter, ...]
    force_std: float | None = None
    position_std: float | None = None
    coordinates: Coordinates = LINE
    band: float = SET.band_hz
    effects: tuple[type[Effect], ...] = field(default_factory=lambda: candidates(LINE, None))
    usual_std: float | None = None
    name: str = AXIS.id
    catalogue: Catalogue = CATALOGUE
    equivalents: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: MappingProxyType({}))
    lanes: ClassVar[int] = LANES
    next_share: ClassVar[float] = SET.axis_next
    _known: dict[tuple[Any, ...], tuple[object, Any]] = field(default_factory=dict, repr=False, compare=False)
    _last: dict[int, tuple[tuple[Any, ...], Array]] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def from_rig(cls, rig: Rig, records: Sequence[Record] = ()) -> AxisKind:
        """The axis that a rig file describes. What it leaves out starts at the size of the `records`, without them at
        10 kg, 100 N s/m, 10 N and 0 N (kg m2, N m s/rad and N m). Raises ValueError where the rig file states a stage
        and the records are of an axis that turns, or the other way round.
        """
        c, catalogue = coordinates_for(rig, records), Catalogue.of(rig)
        stds = stated_noise(rig, c)
        known = [record for record in records if c.force in record.columns]
        band = min((band_of(r["t_s"], r[c.position], stds[1]) for r in records), default=SET.band_hz)
        loads = c.loads_in([n for n in LOADS if records and all(n in r.columns for r in records)])
        size = size_of(c, known, band) if known else None
        effects = candidates(c, size, catalogue, logged_in(known, c, loads, band))
        kind = cls(base_of(rig, c, size), *stds, c, band, effects, catalogue=catalogue)
        rates = [(kind.noise(record).force, kind._moved(record).motion.rate) for record in known]
        shown = [force / passed(rate, band) for force, rate in rates if not math.isnan(force)]
        return replace(kind, usual_std=float(np.median(shown))) if 0 < len(shown) < len(rates) else kind

    @property
    def quantity(self) -> str:
        return self.coordinates.force

    @property
    def unit(self) -> str:
        return self.coordinates.force_unit

    @property
    def error_unit(self) -> str:
        return "%"

    @property
    def measure(self) -> str:
        word, cut = self.coordinates.names[3], f"{2 * self.band:g} Hz"
        relative = f"norm of the {word} error, relative to the norm of the {word}"
        return f"{relative}, both low-passed at {cut} without phase shift"

    def predict(self, record: Record, theta: Theta) -> Array:
        """Force in N (torque in N m) that the measured motion needs, one value a row."""
        return self._forces(record, [theta])[:, 0]

    def _forces(self, record: Record, thetas: Sequence[Theta]) -> Array:
        """That of each of `thetas`, a column each."""
        m, c = self._moved(record).motion, self.coordinates
        if not m.even:
            even = evened(record, (c.position, c.velocity, *LOADS))
            forces = self._forces(even, thetas)
            return np.column_stack([np.interp(record["t_s"], even["t_s"], one) for one in forces.T])
        models = [present((*self.effects, *REFINEMENTS), theta) for theta in thetas]
        effects = [type(e) for e, _ in models[0]]
        if any([type(e) for e, _ in one] != effects for one in models):
            return np.hstack([self._forces(record, [theta]) for theta in thetas])
        own = [[v for _, p in one for v in p.values()] for one in models]
        values = np.array([[*(theta[name] for name in c.base), *more] for theta, more in zip(thetas, own, strict=True)])
        out = self._along(record, effects, values)
        for column, one in zip(out.T, models, strict=True):
            late = sum(float(e.delay(p)) for e, p in one)
            if late:
                column[:] = np.interp(m.t + late, m.t, column)
        return out

    def _along(self, record: Record, effects: Sequence[type[Effect]], values: Array) -> Array:
        """The forces where nothing is late, of a part with what its whole has behind it."""
        whole, part = record.whole or record, slice(record.first, record.first + len(record))
        names, of = self.coordinates.loads_in(whole.columns), self._moved(whole)
        key = (id(of), *(id(whole[column]) for column in names.values()))
        rows = self._kept(key, (of, whole), lambda: rows_of(of.motion, self._seen(whole)))
        if record.whole is None or not any(effect.states for effect in effects):
            return force_along(effects, [*names], values, rows[part])
        at = (whole, tuple(effects), values.tobytes())
        if self._last.get(id(whole), ((), rows))[0] != at:
            self._last[id(whole)] = (at, force_along(effects, [*names], values, rows))
        return self._last[id(whole)][1][part].copy()

    def _seen(self, record: Record) -> Signals:
        of, c = self._moved(record), self.coordinates
        loads = {name: record[column] for name, column in c.loads_in(record.columns).items()}
        load, m = next(iter(loads.values()), 0.0), of.motion
        return Signals(t=m.t, x=m.x, v=m.v, direction=of.direction, travelled=of.path, load=load, loads=loads)

    def residual(self, record: Record, theta: Theta, criterion: int = 0) -> Array:
        return np.asarray(self.stacked(record, [theta], criterion)[0])

    def stacked(self, record: Record, thetas: Sequence[Theta], criterion: int = 0) -> Array:
        return self.of_force(record, thetas)

    def of_force(self, record: Record, thetas: Sequence[Theta]) -> Array:
        """Filtered force errors in units of their noise, a row for each of `thetas`, 100 a second."""
        parts = [thetas[k : k + LANES] for k in range(0, len(thetas), LANES)]
        errors = record[self.quantity][:, None] - np.hstack([self._forces(record, part) for part in parts])
        of = self._moved(record)
        errors[~used(record) | of.still] = 0.0
        return np.ascontiguousarray(decimate(errors.T, of.motion.rate, self.band) / self.noise(record).weight)

    def error(self, records: Sequence[Record], predictions: Sequence[Array]) -> float:
        """The authors' relative force error in %, pooled; rows at rest or near a gap do not count."""
        wrong = right = 0.0
        for record, prediction in zip(records, predictions, strict=True):
            rate = sampling_rate(record["t_s"])
            error = np.where(self._moved(record).still, 0.0, record[self.quantity] - prediction)
            wrong += float(np.sum(decimate(error, rate, self.band) ** 2))
            right += float(np.sum(decimate(record[self.quantity], rate, self.band) ** 2))
        return 100 * float(np.sqrt(wrong / right))

    def noise(self, record: Record) -> AxisNoise:
        """The noise of a record, or of the whole that it is a part of."""
        whole = record.whole or record
        force = whole[self.quantity]
        return self._kept((id(force), self.force_std, self.usual_std), force, lambda: self._estimated(whole))

    def _kept(self, key: tuple[Any, ...], of: object, found: Callable[[], T]) -> T:
        """The value `found` for the `key` of ids of arrays `of`, which are kept so that the ids stay theirs."""
        known = self._known.get(key)
        if known is None:
            if len(self._known) > 128:
                self._known.clear()
            known = self._known[key] = (of, found())
        made: T = known[1]
        return made

    def _estimated(self, record: Record) -> AxisNoise:
        of, force = self._moved(record), record[self.quantity]
        m = of.motion
        own = filtered_noise(force, record[self.coordinates.position], m.rate, self.band, self.force_std)
        speed = 0.0 if of.logged is None else white_part(of.logged)
        _, jolt = through(round(m.rate, 3), self.band, of.logged is not None)
        inertia = inertia_of(force, m, self.band)
        shaken = inertia * jolt * (of.position_noise if of.logged is None else speed)
        size = self._believed(record) if math.isnan(own) else own
        return AxisNoise(own, speed, inertia if shaken else 0.0, max(float(np.hypot(size, shaken)), 1e-12))

    def shaken(self, record: Record) -> bool:
        """Whether the place is too noisy for its acceleration in the usual band, and inertia a part of the force."""
        m = self._moved(record).motion
        inertial = inertia_of(record[self.quantity], m, self.band) * np.std(decimate(m.a, m.rate, self.band))
        size = np.std(decimate(record[self.quantity], m.rate, self.band))
        return bool(self.band < SET.band_hz and inertial > SET.axis_inertial * size)

    def _believed(self, record: Record) -> float:
        """The noise assumed for a force whose own is unknown."""
        rate = sampling_rate(record["t_s"])
        if self.usual_std is not None:
            return self.usual_std * passed(rate, self.band)
        filtered = decimate(record[self.quantity], rate, self.band)
        return float(SET.axis_noise * np.sqrt(np.mean(filtered**2)))

    def noise_floor(self, records: Sequence[Record]) -> float:
        """The error in % that the noise of the quietest record makes; NaN where a noise is unknown."""
        forces = np.concatenate([decimate(r[self.quantity], sampling_rate(r["t_s"]), self.band) for r in records])
        noises = [self.noise(r) for r in records]
        if any(math.isnan(noise.force) for noise in noises):
            return math.nan
        return 100 * min(noise.weight for noise in noises) / math.sqrt(float(np.mean(forces**2)))

    def imitate(self, record: Record, theta: Theta, rng: np.random.Generator) -> Record:
        """The same motion with the model's force and noise of the same size after the filter: the force's own, and that
        of the position (or the logged speed) through the inertia.
        """
        noise, of = self.noise(record), self._moved(record)
        rate = of.motion.rate
        own = self._believed(record) if math.isnan(noise.force) else noise.force
        made = self.predict(record, theta) + own / passed(rate, self.band) * rng.standard_normal(len(record))
        if noise.inertia:
            x = of.position_noise * rng.standard_normal(len(record))
            speed = None if of.logged is None else noise.speed * rng.standard_normal(len(record))
            made = made + noise.inertia * motion(of.motion.t, x, speed, self.band).a
        return replace(record.with_column(self.quantity, made), whole=record.whole or record)

    def splits(self, records: Sequence[Record]) -> list[Split]:
        return splits_of(records, self.coordinates.position, Record.part)

    def signals(self, record: Record) -> dict[str, Array]:
        """Time, position, speed, acceleration, force and logged inputs."""
        m, c = self._moved(record).motion, self.coordinates
        drawn = dict(zip(("t_s", *c.names[:3], c.force), (m.t, m.x, m.v, m.a, record[c.force]), strict=True))
        return drawn | {load: record[load] for load in c.loads_in(record.columns).values()}

    def extra_force(self, record: Record, theta: Theta) -> tuple[Array, Array] | None:
        return self.predict(record, theta) - record[self.quantity], record[self.quantity]

    def _moved(self, record: Record) -> Moved:
        c, whole = self.coordinates, record.whole
        key = (id(whole), *(id(record.columns.get(name)) for name in ("t_s", c.position, c.velocity)))
        if whole is not None:
            return self._kept(key, record, lambda: self._moved(whole).part(record))
        return self._kept(key, record, lambda: moved(record, c, self.position_std, self.band))


def coordinates_for(rig: Rig, records: Sequence[Record]) -> Coordinates:
    """Those of the `records`, without any those that the rig file states. Raises ValueError where these differ."""
    known = {LINE.position, TURN.position, LINE.force, TURN.force}
    placed = [record for record in records if known & record.columns.keys()]
    c = coordinates_of(placed)
    own = {name for one in (LINE, TURN) for name in one.base}
    stated = (name for name, value in rig.axis.model_dump().items() if value is not None and name in own)
    strange = next((name for name in stated if name not in c.base), None)
    if strange is not None and placed:
        keys = ", ".join(c.base)
        raise ValueError(f"[axis] {strange} must not be there for records with {c.position}, whose keys are {keys}")
    return TURN if not placed and (strange is not None or rig.driven == TURN.force) else c


def stated_noise(rig: Rig, c: Coordinates) -> tuple[float | None, float | None]:
    """Standard deviations of force and place that the rig file states."""
    noise = rig.noise
    return (noise.torque_std_N_m, noise.angle_std_rad) if c.turns else (noise.force_std_N, noise.position_std_m)


def base_of(rig: Rig, c: Coordinates, size: Size | None) -> tuple[Parameter, ...]:
    """The base parameters as the rig file states them, else as a start."""
    rows = []
    for name, unit, (start, lower, upper) in zip(c.base, c.units, _spans(c, size), strict=True):
        stated = getattr(rig.axis, name)
        at = start if stated is None else stated
        rows.append(Parameter(name, at, unit, min(lower, at), max(upper, at), _BELIEF, fit=True))
    return tuple(rows)


def _spans(c: Coordinates, size: Size | None) -> Sequence[Range]:
    """Start, lower and upper bound of the base parameters; a stage keeps its own starts and the wider bounds."""
    usual = ((10.0, 1e-4, 1e3), (100.0, 0.0, 1e4), (10.0, 0.0, 1e3), (0.0, -1e3, 1e3))
    if size is None:
        return usual
    force, mass, drag = size.force, size.force / size.acceleration, size.force / size.speed
    sized = (
        (0.3 * mass, 1e-4 * mass, 30 * mass),
        (0.2 * drag, 0.0, 10 * drag),
        (0.2 * force, 0.0, 3 * force),
        (0.0, -3 * force, 3 * force),
    )
    if c.turns:
        return sized
    both = zip(usual, sized, strict=True)
    return [(at, min(low, lower), max(high, upper)) for (at, low, high), (_, lower, upper) in both]


def size_of(c: Coordinates, records: Sequence[Record], band: float) -> Size:
    """The 98th percentile of each signal of the records, and the ends of the position."""
    motions = [motion(record["t_s"], record[c.position], band=band) for record in records]

    def most(parts: Sequence[Array]) -> float:
        return max(float(np.percentile(np.abs(np.concatenate(parts)), 98)), 1e-9)

    x = np.concatenate([m.x for m in motions])
    return Size(
        most([m.v for m in motions]),
        most([m.a for m in motions]),
        most([record[c.force] for record in records]),
        float(x.min()),
        float(x.max()),
    )


def splits_of(
    records: Sequence[Record], position: str, cut: Cut = lambda record, a, b: record.rows(slice(a, b))
) -> list[Split]:
    """By record, of many by groups of them; where one alone holds a speed, direction or position, by four blocks of
    each record's cycle, which are `cut` from it.
    """
    count = len(records) if len(records) <= SET.axis_groups else SET.many_groups
    groups = [records[k::count] for k in range(count)]
    apart = [([r for r in records if r not in group], [*group]) for group in groups]
    if len(records) > 1 and all(may_be_left_out(out, rest) for rest, group in apart for out in group):
        return apart
    each = [_blocks_of_cycle(record, position, cut) for record in records]
    return [
        ([r for part, _ in row for r in part], [r for _, part in row for r in part]) for row in zip(*each, strict=True)
    ]


def _blocks_of_cycle(record: Record, position: str, cut: Cut) -> list[Split]:
    """Splits by four blocks of the record's cycle of motion (else of its length), each left out once."""
    rate = sampling_rate(record["t_s"])
    lag = repeat_lag(record[position], rate) or len(record)
    block = (np.arange(len(record)) % lag) * _BLOCKS // lag
    edges = [0, *(np.flatnonzero(np.diff(block)) + 1), len(record)]
    pieces = [(int(block[a]), cut(record, a, b)) for a, b in pairwise(edges) if b - a > SET.piece_s * rate]
    return [([p for k, p in pieces if k != out], [p for k, p in pieces if k == out]) for out in range(_BLOCKS)]
