"""What a residual that no known effect explains depends on: curves and surfaces over state and time, with the share of
the residual that each predicts; a tone; and the proposed term.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from models.identification.finding import Dependence, ResidualCurve, ResidualSurface, Tone
from models.identification.kind import Array, Kind
from models.identification.residual_term import SYMBOLS, term_of
from models.identification.settings import SET
from models.records.record import Record
from models.rigs.columns import TIME
from models.theta import Theta

Index = NDArray[np.int64]
AXES: Final = ("-v", "+x")
"""Directions of a residual: against the motion, where a resistance is positive, and along +x."""


def dependence_of(kind: Kind, records: Sequence[Record], theta: Theta, seed: int = 0) -> Dependence | None:
    """What the residual of the model at `theta` on `records` depends on; None where it is no time series."""
    residual = _Residual.of(kind, records, theta) if records else None
    if residual is None or len(residual.values) < 2:
        return None
    rng = np.random.default_rng(seed)
    best: dict[str, ResidualCurve] = {}
    found = (_curve(residual, name, along, rng) for name in residual.signals for along in AXES)
    for curve in sorted((one for one in found if one is not None), key=lambda one: -one.share):
        best.setdefault(curve.variable, curve)
    curves = tuple(best.values())
    proposed = next((c for c in curves if c.variable in SYMBOLS and c.share >= SET.curve_tells), None)
    level = float(residual.acting.mean())
    term = term_of(proposed, residual.unit, level) if proposed is not None and level else None
    names, surface = tuple(record.name for record in records), _surface(residual, curves, rng)
    tone = _tone(kind, records, theta)
    return Dependence(residual.quantity, residual.unit, names, curves, surface, tone, term, level)


@dataclass(frozen=True)
class _Residual:
    """Samples (n,) while the body moves: `values` of the residual along +x in `unit`, as a force where it is one; the
    `signals` by name; the `direction` of motion; the size of the force that moves the body (`acting`; 0 where it is
    unknown); the `stretch` and the `fold` (the record, where there are several) of each sample.
    """

    quantity: str
    unit: str
    values: Array
    signals: dict[str, Array]
    direction: Array
    acting: Array
    stretch: Index
    fold: Index

    def along(self, axis: str) -> Array:
        """The values along one of `AXES`."""
        return self.values if axis == "+x" else -self.direction * self.values

    @classmethod
    def of(cls, kind: Kind, records: Sequence[Record], theta: Theta) -> _Residual | None:
        """The residual of `records` at `theta`; None for several measured columns and for tables."""
        signals = [{name: y for name, y in kind.signals(record).items() if name != kind.quantity} for record in records]
        speed = next((name for name in signals[0] if name.startswith("v_")), None)
        if speed is None or any(np.ndim(kind.measured(record)) != 1 for record in records):
            return None
        least = SET.residual_moving * max(float(np.nanmax(np.abs(own[speed]))) for own in signals)
        names = [name for name in signals[0] if all(name in own for own in signals)]
        forced, parts = False, []
        for number, (record, own) in enumerate(zip(records, signals, strict=True)):
            extra = kind.extra_force(record, theta)
            forced = extra is not None
            rest, acting = extra or (kind.measured(record) - kind.predict(record, theta), np.zeros(len(record)))
            stretch = np.arange(len(rest)) * SET.residual_stretches // len(rest)
            fold = np.full(len(rest), number) if len(records) > 1 else stretch % SET.residual_folds
            columns = [rest, np.sign(own[speed]), np.abs(acting), number * SET.residual_stretches + stretch, fold]
            good = np.all([np.isfinite(y) for y in (*own.values(), *columns)], axis=0) & (np.abs(own[speed]) > least)
            parts.append([column[good] for column in (*columns, *(own[name] for name in names))])
        values, direction, acting, stretch, fold, *rows = map(np.concatenate, zip(*parts, strict=True))
        quantity, unit = "extra force" if forced else kind.quantity, "N" if forced and kind.unit == "m" else kind.unit
        shown = dict(zip(names, rows, strict=True))
        return cls(quantity, unit, values, shown, direction, acting, stretch.astype(np.int64), fold.astype(np.int64))


def _curve(residual: _Residual, variable: str, along: str, rng: np.random.Generator) -> ResidualCurve | None:
    """The residual over `variable` with intervals by block bootstrap; None where too few stretches share a bin."""
    bins, y = _Bins.of(residual, (variable,), along, SET.curve_bins), residual.along(along)
    mean, low, high, enough = bins.means(y, residual.stretch, rng)
    if enough.sum() < 3:
        return None
    weights = np.bincount(bins.cell, weights=bins.signals[0], minlength=bins.size)
    centres = weights / np.maximum(np.bincount(bins.cell, minlength=bins.size), 1)
    share = predicted_share(bins.cell, y, residual.fold)
    return ResidualCurve(variable, along, share, centres[enough], mean[enough], low[enough], high[enough])


def _surface(residual: _Residual, curves: Sequence[ResidualCurve], rng: np.random.Generator) -> ResidualSurface | None:
    """The best surface over two of the best variables, where it predicts clearly more than the best curve."""
    names = [curve.variable for curve in curves[: SET.surface_paired]]
    surfaces = []
    for pair, along in itertools.product(itertools.combinations(names, 2), AXES):
        bins, y = _Bins.of(residual, pair, along, SET.surface_bins), residual.along(along)
        mean, low, high, enough = bins.means(y, residual.stretch, rng)
        half = 0.5 * (high - low)
        mean[~enough], half[~enough] = np.nan, np.nan
        first, second = (0.5 * (edges[1:] + edges[:-1]) for edges in bins.edges)
        share, shape = predicted_share(bins.cell, y, residual.fold), bins.shape
        surfaces.append(ResidualSurface(pair, along, share, (first, second), mean.reshape(shape), half.reshape(shape)))
    best = max(surfaces, key=lambda surface: surface.share, default=None)
    return best if best is not None and best.share > curves[0].share + SET.surface_more else None


def predicted_share(cell: Index, y: Array, fold: Index) -> float:
    """Share of the variance of `y` (n,) that the means of its cells predict on other folds; at least 0."""
    wrong = power = 0.0
    for one in np.unique(fold):
        held, rest = fold == one, fold != one
        if not rest.any():
            return 0.0
        size = int(cell.max()) + 1
        counts = np.bincount(cell[rest], minlength=size)
        sums = np.bincount(cell[rest], weights=y[rest], minlength=size)
        mean = float(y[rest].mean())
        predicted = np.where(counts > 0, sums / np.maximum(counts, 1), mean)[cell[held]]
        wrong += float(np.sum((y[held] - predicted) ** 2))
        power += float(np.sum((y[held] - mean) ** 2))
    return max(1 - wrong / power, 0.0) if power > 0 else 0.0


@dataclass(frozen=True)
class _Bins:
    """Cells between `edges` with equally many samples along each of the `signals`; `cell` that of each sample."""

    signals: Sequence[Array]
    edges: Sequence[Array]
    cell: Index

    @classmethod
    def of(cls, residual: _Residual, variables: Sequence[str], along: str, count: int) -> _Bins:
        """Over the signals themselves; against the motion, over the size of a speed or gap."""
        signals = [
            np.abs(residual.signals[name])
            if along == "-v" and name.startswith(("v_", "gap"))
            else residual.signals[name]
            for name in variables
        ]
        edges = [np.unique(np.quantile(signal, np.linspace(0, 1, count + 1))) for signal in signals]
        cell: Index = np.zeros(len(residual.values), dtype=np.int64)
        for signal, own in zip(signals, edges, strict=True):
            at = np.clip(np.searchsorted(own, signal, side="right") - 1, 0, len(own) - 2)
            cell = cell * (len(own) - 1) + at
        return cls(signals, edges, cell)

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each signal."""
        return tuple(len(own) - 1 for own in self.edges)

    @property
    def size(self) -> int:
        """Number of cells."""
        return int(np.prod(self.shape))

    def means(
        self, y: Array, stretch: Index, rng: np.random.Generator
    ) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
        """Mean of each cell with its 95 % interval, and whether enough stretches share it."""
        rows = int(stretch.max()) + 1
        at, length = stretch * self.size + self.cell, rows * self.size
        counts = np.bincount(at, minlength=length).reshape(rows, -1).astype(float)
        sums = np.bincount(at, weights=y, minlength=length).reshape(rows, -1)
        mean = sums.sum(axis=0) / np.maximum(counts.sum(axis=0), 1)
        drawn = rng.multinomial(rows, np.full(rows, 1 / rows), size=SET.curve_draws)
        drawn_counts = drawn @ counts
        some = np.where(drawn_counts > 0, (drawn @ sums) / np.maximum(drawn_counts, 1e-300), mean)
        low, high = np.percentile(some, SET.curve_interval, axis=0)
        return mean, np.minimum(low, mean), np.maximum(high, mean), (counts > 0).sum(axis=0) >= SET.curve_least


def _tone(kind: Kind, records: Sequence[Record], theta: Theta) -> Tone | None:
    """The strongest line in the spectrum of the residual that the motion does not have."""
    if any(TIME not in record.columns for record in records):
        return None
    rows, spectra, motions = min(map(len, records)), list[Array](), list[Array]()
    for record in records:
        step = float(record[TIME][-1] - record[TIME][0]) / (len(record) - 1)
        own = kind.signals(record)
        position = next((signal for name, signal in own.items() if name.startswith("x_")), np.zeros(len(record)))
        for found, signal in ((spectra, kind.measured(record) - kind.predict(record, theta)), (motions, position)):
            f, power = scipy.signal.welch(np.nan_to_num(signal), 1 / step, nperseg=rows, detrend="linear")
            found.append(power / max(float(power.sum()), 1e-300))
    spectrum, motion = np.mean(spectra, axis=0), np.mean(motions, axis=0)
    peak = SET.cycles + int(np.argmax(spectrum[SET.cycles :])) if len(spectrum) > SET.cycles else 0
    if not peak:
        return None
    line = slice(peak - 1, peak + 2)
    share = float(spectrum[line].sum())
    own_tone = share >= SET.residual_tone and float(motion[line].sum()) < SET.residual_motion * share
    return Tone(float(f[peak]), share) if own_tone else None
