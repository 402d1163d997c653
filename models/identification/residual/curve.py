"""Curves and surfaces of the residual over one or two signals, each with the share of it that they foretell."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.identification.finding import ResidualCurve, ResidualSurface
from models.identification.kind import Array
from models.identification.residual.left import Left
from models.identification.settings import SET

Index = NDArray[np.int64]


def curve_of(left: Left, variable: str, way: str, rng: np.random.Generator) -> ResidualCurve | None:
    """The residual over `variable`, along the motion's axis or against the motion (`way`); None where too few stretches
    share a bin. Intervals by bootstrap of whole stretches, which keeps what neighbours have in common.
    """
    bins = _Bins.of(left, (variable,), way, SET.curve_bins)
    mean, low, high, enough = bins.means(left.along(way), left.stretch, rng)
    if enough.sum() < 3:
        return None
    weights = np.bincount(bins.cell, weights=bins.signals[0], minlength=bins.size)
    centres = weights / np.maximum(np.bincount(bins.cell, minlength=bins.size), 1)
    share = foretold(bins.cell, left.along(way), left.fold)
    return ResidualCurve(variable, way, share, centres[enough], mean[enough], low[enough], high[enough])


def surface_of(left: Left, variables: tuple[str, str], way: str, rng: np.random.Generator) -> ResidualSurface:
    """The same over two variables at once."""
    bins = _Bins.of(left, variables, way, SET.surface_bins)
    mean, low, high, enough = bins.means(left.along(way), left.stretch, rng)
    half = 0.5 * (high - low)
    mean[~enough], half[~enough] = np.nan, np.nan
    first, second = (0.5 * (edges[1:] + edges[:-1]) for edges in bins.edges)
    share = foretold(bins.cell, left.along(way), left.fold)
    return ResidualSurface(variables, way, share, (first, second), mean.reshape(bins.shape), half.reshape(bins.shape))


def foretold(cell: Index, y: Array, fold: Index) -> float:
    """Share of `y` (n,) about its mean that its cells' means foretell on other folds; at least 0."""
    wrong = power = 0.0
    for one in np.unique(fold):
        held, rest = fold == one, fold != one
        if not rest.any():
            return 0.0
        size = int(cell.max()) + 1
        counts = np.bincount(cell[rest], minlength=size)
        sums = np.bincount(cell[rest], weights=y[rest], minlength=size)
        mean = float(y[rest].mean())
        foreseen = np.where(counts > 0, sums / np.maximum(counts, 1), mean)[cell[held]]
        wrong += float(np.sum((y[held] - foreseen) ** 2))
        power += float(np.sum((y[held] - mean) ** 2))
    return max(1 - wrong / power, 0.0) if power > 0 else 0.0


@dataclass(frozen=True)
class _Bins:
    """Cells between `edges` with equally many samples along each of the `signals`; `cell` that of each sample."""

    signals: Sequence[Array]
    edges: Sequence[Array]
    cell: Index

    @classmethod
    def of(cls, left: Left, variables: Sequence[str], way: str, count: int) -> "_Bins":
        """Of the signals themselves; against the motion, of the size of a speed."""
        signals = [
            np.abs(left.signals[name]) if way == "-v" and name.startswith(("v_", "gap")) else left.signals[name]
            for name in variables
        ]
        edges = [np.unique(np.quantile(signal, np.linspace(0, 1, count + 1))) for signal in signals]
        cell: Index = np.zeros(len(left.values), dtype=np.int64)
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
        """Cells in all."""
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


def ranked(curves: Sequence[ResidualCurve | None]) -> tuple[ResidualCurve, ...]:
    """Those that are told, from the one that foretells most on; of a variable's two ways the better one."""
    best: dict[str, ResidualCurve] = {}
    for curve in sorted((c for c in curves if c is not None), key=lambda c: -c.share):
        best.setdefault(curve.variable, curve)
    return tuple(best.values())
