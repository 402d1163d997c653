"""Time series of a capsule in the gut or on a plate, under any drive, predicted by the assembled model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from types import MappingProxyType
from typing import ClassVar, Self

import numpy as np
import scipy
from numpy.typing import NDArray

from models.checks.estimators import estimated_noise, grid_step
from models.checks.noise import noise_used
from models.checks.usable import RUN_IN, counted, filled, from_row, used
from models.compiled.kernel import LANES
from models.compiled.residuals import weighed
from models.drives.drive import Drive
from models.effects import CATALOGUE, Catalogue
from models.effects.effect import Effect
from models.files.units import unit_at_end
from models.identification.kind import Array, Kind, Split
from models.identification.kinds.conditions import may_be_left_out
from models.identification.kinds.series.drive_input import (
    KEPT,
    clock_offset,
    driven_column,
    interval,
    read_late,
    switch_delay,
)
from models.identification.kinds.series.simulation import Runner
from models.identification.settings import SET
from models.parameter import Parameter
from models.records.record import Record
from models.rigs.columns import FURTHER
from models.rigs.kinds import KINDS, drive_of, surface_of
from models.rigs.rig import Rig
from models.rigs.tables import Noise
from models.surfaces.surface import Surface
from models.theta import Theta

_WALL_HOOKS = ("stiffening", "wall_force", "recovery")


def low_passed(signal: Array, dt: float) -> Array:
    """`signal` (..., n) below 2 Hz: Butterworth, second order, forward and back, so without phase."""
    if signal.shape[-1] < 16 or SET.low_pass_hz * 2 * dt >= 1:
        return signal
    sections = scipy.signal.butter(2, 2 * SET.low_pass_hz * dt, output="sos")
    return np.asarray(scipy.signal.sosfiltfilt(sections, signal))


@lru_cache(maxsize=KEPT)
def _rows(record: Record, column: str, place: str, away: float) -> NDArray[np.int64]:
    """The rows whose residuals in `column` count: of a further one, once the `place` is so far `away` from its start.
    While a body rests where a noisy place has it, a magnet's force is off by that noise.
    """
    if column not in FURTHER:
        return np.flatnonzero(counted(record))
    rows = np.flatnonzero(np.isfinite(record[column]) & (record.columns.get(RUN_IN, 0.0) == 0))
    x = record.columns.get(place, np.zeros(1))
    return rows[rows >= np.argmax(np.abs(x - x[0]) > away)] if away else rows


@dataclass(frozen=True)
class SeriesKind(Kind):
    """A rig whose records are time series of a capsule. `noise_std` is the sensor's; residuals of `averaged` neighbours
    count as one, their mean in units of its own noise, which shows structure below the noise of a sample. `resolution`
    is the step of a coarse sensor, else 0. `beside` has the noise of each further measured column, whose zero is
    unknown, so that means do not count. Of a kind with a `column` only that one counts.
    """

    surface: Surface
    drive: Drive
    noise_std: float
    base: tuple[Parameter, ...] = ()
    effects: tuple[type[Effect], ...] = ()
    averaged: int = 1
    resolution: float = 0.0
    equivalents: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: MappingProxyType({}))
    beside: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    column: str = ""
    catalogue: Catalogue = CATALOGUE
    measure: str = "rms error of the free-running prediction, low-passed at 2 Hz"
    criteria: ClassVar[int] = 2  # the observer, and the free run
    judges: ClassVar[tuple[int, ...]] = (0, 1)  # under the observer, slip events out of step cost little
    next_share: ClassVar[float] = SET.series_next
    least_gain: ClassVar[float] = SET.series_gain
    lanes: ClassVar[int] = LANES
    tail: ClassVar[float] = SET.tail

    @classmethod
    def from_rig(cls, rig: Rig, records: Sequence[Record]) -> SeriesKind:
        """The kind that a rig file describes under the drive of `records`; the noise is estimated where not stated.
        Raises ValueError for another kind of rig, and for records with different driven columns.
        """
        drive = drive_of(rig, driven_column(rig.kind, records))
        stated = rig.noise.force_std_N if drive.imposed else rig.noise.position_std_m
        noise = series_noise(records, drive.measured, stated)
        made = cls.build(surface_of(rig), drive, noise, records, Catalogue.of(rig))
        beside = noise_beside(records, rig.noise)
        late = (p for name in beside for p in read_late(FURTHER[name], rig.clock))
        base, step = (*made.base, *clock_offset(rig.clock), *late), resolution(records, drive.measured)
        return replace(made, base=base, resolution=step, beside=MappingProxyType(beside))

    @classmethod
    def build(
        cls,
        surface: Surface,
        drive: Drive,
        noise_std: float,
        records: Sequence[Record] = (),
        catalogue: Catalogue = CATALOGUE,
    ) -> SeriesKind:
        """The kind for a surface and a drive; `records` show how a switch was logged."""
        base = surface.parameters() + drive.parameters() + switch_delay(drive, records)
        effects = tuple(
            e for e in catalogue.acting_on(drive.name) if surface.dragged or not any(map(e.answers, _WALL_HOOKS))
        )
        averaged = averaged_samples(drive.measured, noise_std, records)
        return cls(surface, drive, noise_std, base, effects, averaged, catalogue=catalogue)

    @property
    def name(self) -> str:
        return self.drive.name

    @property
    def quantity(self) -> str:
        return self.column or self.drive.measured

    @property
    def channels(self) -> tuple[str, ...]:
        return (self.column,) if self.column else (self.drive.measured, *self.beside)

    def alone(self, column: str) -> Self:
        own = column in self.beside
        measure = "rms error of the free-running prediction about its mean" if own else self.measure
        return replace(self, column=column, measure=measure) if self.beside else self

    def _std(self, column: str) -> float:
        return self.beside.get(column, self.noise_std)

    def _rows(self, record: Record, column: str) -> NDArray[np.int64]:
        return _rows(record, column, self.drive.measured, SET.left_start * self.noise_std * self.drive.anchored)

    @property
    def unit(self) -> str:
        return unit_at_end(self.column)[1] if self.column in self.beside else "N" if self.drive.imposed else "m"

    @property
    def final(self) -> int:
        return 2  # the free run at fine steps

    @property
    def memory(self) -> float:
        """The observer's time constant in s."""
        return float(SET.held_s if self.drive.held else SET.memory_s if self.drive.anchored else SET.drifts_s)

    @property
    def beginnings_s(self) -> tuple[float, ...]:
        return tuple(SET.shaken_beginnings_s if self.drive.held else SET.beginnings_s)

    @property
    def _runs(self) -> Callable[..., Array]:
        return Runner(self.surface, self.drive, self.catalogue).runs

    def _from_the_start(self, record: Record, outputs: Array) -> Array:
        """`outputs` (k, n) moved to where the record starts: the noise of one sample there would last to the end."""
        column = self.drive.measured
        if self.drive.anchored or column not in record.columns:
            return outputs
        shown = np.flatnonzero(used(record))
        first = shown[: max(int(np.searchsorted(shown, round(SET.start_s / interval(record)))), SET.start_images)]
        away = record[column][first] - np.take(outputs, first, axis=1)
        return np.asarray(outputs + away.mean(axis=1, keepdims=True))

    def predict(self, record: Record, theta: Theta) -> Array:
        """The free run from the driven column alone, from rest where the record starts (a magnet's below it)."""
        return self.predictions(record, [theta])[0]

    def predictions(self, record: Record, thetas: Sequence[Theta]) -> list[Array]:
        placed = not self.drive.anchored and self.drive.measured in record.columns
        return list(self._outputs(record, thetas, None, placed)[self.quantity])

    def _outputs(
        self, record: Record, thetas: Sequence[Theta], memory: float | None, placed: bool = True, fine: bool = True
    ) -> dict[str, Array]:
        """What the sensors show at each of `thetas`, (k, n) by column; under an observer where there is a `memory`."""
        more = {name: np.empty((len(thetas), len(record))) for name in self.beside}
        outputs = self._runs(record, thetas, memory, placed, fine, more)
        return {self.drive.measured: outputs if memory else self._from_the_start(record, outputs), **more}

    def residual(self, record: Record, theta: Theta, criterion: int = 0) -> Array:
        """Differences in units of the noise, with less weight in the jump of a slip event; see `Kind.residual`."""
        return np.asarray(self.stacked(record, [theta], criterion)[0])

    def stacked(self, record: Record, thetas: Sequence[Theta], criterion: int = 0) -> Array:
        outputs = self._outputs(record, thetas, None if criterion else self.memory, fine=criterion == self.final)
        parts = [self._weighed(record, column, outputs[column]) for column in self._logged(record)]
        return np.asarray(parts[0] if len(parts) == 1 else np.hstack(parts))

    def _logged(self, record: Record) -> list[str]:
        """The channels that a record has."""
        return [column for column in self.channels if column in record.columns]

    def _weighed(self, record: Record, column: str, outputs: Array) -> Array:
        rows, averaged = self._rows(record, column), self._averaged(record, column)
        if column in self.beside:
            outputs = outputs + (record[column] - outputs)[:, rows].mean(axis=1, keepdims=True)
        weight = (SET.diverged, self.tail)
        return np.asarray(weighed(outputs, record[column], rows, averaged, self._std(column), *weight))

    def _averaged(self, record: Record, column: str) -> int:
        quick = column in FURTHER and FURTHER[column].rate
        return 1 if quick or len(self._rows(record, column)) < 2 * self.averaged else self.averaged

    def slow(self, records: Sequence[Record], rows: Array) -> Array:
        if not self.beside:
            return self._slow(rows, SET.slow_s / (interval(records[0]) * self.averaged))
        parts, end = list[Array](), 0
        for record in records:
            for column in self._logged(record):
                size = len(self._rows(record, column)) // self._averaged(record, column)
                seconds = interval(record) * len(record)
                parts.append(self._slow(rows[:, end : end + size], SET.slow_s * size / seconds))
                end += size
        return np.hstack(parts)

    def _slow(self, rows: Array, count: float) -> Array:
        """Means of `count` neighbours of `rows`."""
        count = max(1, round(count))
        if rows.shape[1] < count:
            return rows
        some = rows[:, : rows.shape[1] // count * count]
        plain = some * np.sqrt(1 + (some / (2 * self.tail)) ** 2)  # without the weight in the tail
        return np.asarray(plain.reshape(len(rows), -1, count).mean(axis=2) * np.sqrt(count))

    def error(self, records: Sequence[Record], predictions: Sequence[Array]) -> float:
        """Rms of the prediction error low-passed at 2 Hz, over the samples that count."""
        parts = [
            self.off(r, predicted)[self._rows(r, self.quantity)]
            for r, predicted in zip(records, predictions, strict=True)
        ]
        return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))

    def off(self, record: Record, predicted: Array) -> Array:
        """The prediction error low-passed at 2 Hz, interpolated between the samples that count; of a further column, as
        it is about its mean.
        """
        if self.column in self.beside:
            off = record[self.column] - predicted
            return np.asarray(off - off[self._rows(record, self.column)].mean())
        good, t = counted(record), record["t_s"]
        return low_passed(np.interp(t, t[good], (record[self.quantity] - predicted)[good]), interval(record))

    def noise_floor(self, records: Sequence[Record]) -> float:
        """White noise of `noise_std` through the same low-pass."""
        rng = np.random.default_rng(0)
        std, column = self._std(self.quantity), self.quantity
        made = [(r, r[column] + std * rng.standard_normal(len(r))) for r in records]
        return self.error([r for r, _ in made], [p for _, p in made])

    def imitate(self, record: Record, theta: Theta, rng: np.random.Generator) -> Record:
        """The same drive with the model's output and white noise of the stated size, in the sensor's steps."""
        steps = self.resolution / np.sqrt(12)
        white = np.sqrt(max(self.noise_std**2 - steps**2, 0.0)) * rng.standard_normal(len(record))
        made, place = self.made(record, theta), self.drive.measured
        output = made[place] + white
        if self.resolution:
            output = self.resolution * np.round(output / self.resolution)
        more = {c: made[c] + std * rng.standard_normal(len(record)) for c, std in self.beside.items()}
        return filled(made.with_columns({place: output, **more}), place)

    def searched(self, records: Sequence[Record]) -> list[Record]:
        """The beginnings of a shaken body, which strikes in every period of its drive; all of others."""
        return [record.beginning(SET.shaken_s) if self.drive.held else record for record in records]

    def splits(self, records: Sequence[Record]) -> list[Split]:
        """The last record validates the others; where it is the only one with a speed, a direction or a position, the
        second halves of all records validate the first. A second half runs from the record's start: a clock, a way, a
        wall and a body go on from the first.
        """
        if len(records) > 1 and may_be_left_out(records[-1], records[:-1]):
            return [(list(records[:-1]), [records[-1]])]
        halves = [len(r) // 2 for r in records]
        first = [r.rows(slice(0, half)) for r, half in zip(records, halves, strict=True)]
        return [(first, [from_row(r, half) for r, half in zip(records, halves, strict=True)])]

    def signals(self, record: Record) -> dict[str, Array]:
        t, x = record["t_s"], record[self.drive.commanded if self.drive.imposed else self.drive.measured]
        step = interval(record)
        path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(low_passed(x, step))))])
        out = {"t_s": t, "x_m": x, "v_m_s": np.gradient(low_passed(x, step), step), "travelled_m": path}
        if self.drive.imposed:
            return out | {"force_N": record[self.quantity]}
        if not self.drive.anchored:
            return out | {self.drive.commanded: record[self.drive.commanded]}
        return out | {"gap_m": record[self.drive.commanded] - x}

    def extra_force(self, record: Record, theta: Theta) -> tuple[Array, Array] | None:
        """What was predicted beyond a measured force; at a measured position, how much less a magnet pulls there."""
        predicted, measured = self.predict(record, theta), record[self.quantity]
        if self.drive.imposed:
            return predicted - measured, measured
        if not self.drive.anchored:
            return None
        command = record[self.drive.commanded] / self.drive.command_unit
        there, foreseen = (np.asarray(self.drive.force(x, 0.0, command, theta.base)) for x in (measured, predicted))
        return foreseen - there, there

    def foresight_rms(self, records: Sequence[Record], thetas: Sequence[Theta], memory: float | None) -> list[float]:
        """Rms error of `records` at each of `thetas` under an observer with the time constant `memory` in s; None:
        free-running.
        """
        outputs = [self._runs(record, thetas, memory) for record in records]
        measured = np.concatenate([record[self.quantity] for record in records])
        errors = (measured - np.concatenate(own) for own in zip(*outputs, strict=True))
        return [float(np.sqrt(np.mean(error**2))) for error in errors]


def averaged_samples(column: str, noise_std: float, records: Sequence[Record]) -> int:
    """Neighbours whose mean is as good as a sample of a fine sensor, within the time of a change of motion."""
    fine, longest_s = (SET.fine_force_N, SET.tooth_s) if column == "force_N" else (SET.fine_place_m, SET.swing_s)
    if not records or noise_std <= SET.noisy * fine:
        return 1
    rate = float(np.median([used(record).mean() / interval(record) for record in records]))
    return int(max(1, round(min((noise_std / fine) ** 2, longest_s * rate))))


def series_noise(records: Sequence[Record], column: str, stated: float | None) -> float:
    """Standard deviation of the noise of `column`: as stated, unless the records are noisier; never 0."""
    measured = [record for record in records if column in record.columns]
    values = [r[column][np.isfinite(r[column]) if column in FURTHER else used(r)] for r in measured]
    if not values:
        return stated or SET.no_noise
    vibrates = KINDS[measured[0].kind].vibrates
    estimated = float(np.median([estimated_noise(y, vibrates, stated) for y in values]))
    span, step = float(np.ptp(np.concatenate(values))), float(np.median([grid_step(y) for y in values]))
    return float(max(noise_used(stated, estimated, span, step), SET.no_noise))


def noise_beside(records: Sequence[Record], stated: Noise) -> dict[str, float]:
    """Standard deviation of the noise of each further column that `records` have; of an instrument, with its scale."""
    found = dict[str, float]()
    for name in records[0].layout.beside if records else ():
        if moved := [np.nanstd(record[name]) for record in records if name in record.columns]:
            noise = series_noise(records, name, getattr(stated, FURTHER[name].key("std"), None))
            found[name] = float(np.hypot(noise, SET.accelerometer * np.median(moved) * FURTHER[name].instrument))
    return found


def resolution(records: Sequence[Record], column: str) -> float:
    """The step of the scale on which the used values of `column` lie; 0 for none."""
    steps = [grid_step(record[column][used(record)]) for record in records if column in record.columns]
    return float(np.median(steps)) if steps else 0.0
