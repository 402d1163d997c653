"""Curves and surfaces of the residual over one or two signals, each with the share of it that they foretell."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from models.identification.finding import Curve, Surface
from models.identification.kind import Array
from models.identification.residual.left import Left
from models.identification.settings import SET

Index = NDArray[np.int64]


def curve_of(left: Left, variable: str, way: str, rng: np.random.Generator) -> Curve | None:
    """The residual over `variable`, along the motion's axis or against the motion (`way`); None where too few stretches
    share a bin. Intervals by bootstrap of whole stretches, which keeps what neighbours have in common.
    """
    signal, y = _over(left, variable, way), left.along(way)
    edges = _edges(signal, SET.curve_bins)
    cell = _cells(signal, edges)
    means, low, high, enough = _means(cell, y, left.stretch, len(edges) - 1, rng)
    if enough.sum() < 3:
        return None
    counts = np.maximum(np.bincount(cell, minlength=len(edges) - 1), 1)
    centres = np.bincount(cell, weights=signal, minlength=len(edges) - 1) / counts
    share = foretold(cell, y, left.fold)
    return Curve(variable, way, share, centres[enough], means[enough], low[enough], high[enough])


def surface_of(left: Left, variables: tuple[str, str], way: str, rng: np.random.Generator) -> Surface:
    """The same over two variables at once."""
    signals = [_over(left, variable, way) for variable in variables]
    edges = [_edges(signal, SET.surface_bins) for signal in signals]
    cells = [_cells(signal, own) for signal, own in zip(signals, edges, strict=True)]
    shape = (len(edges[0]) - 1, len(edges[1]) - 1)
    cell = cells[0] * shape[1] + cells[1]
    y = left.along(way)
    means, low, high, enough = _means(cell, y, left.stretch, shape[0] * shape[1], rng)
    half = 0.5 * (high - low)
    means[~enough], half[~enough] = np.nan, np.nan
    centres = (0.5 * (edges[0][1:] + edges[0][:-1]), 0.5 * (edges[1][1:] + edges[1][:-1]))
    share = foretold(cell, y, left.fold)
    return Surface(variables, way, share, centres, means.reshape(shape), half.reshape(shape))


def foretold(cell: Index, y: Array, fold: Index) -> float:
    """Share of `y` (n,) about its mean that the means of its cells foretell on folds that they were not made on; at
    least 0. A cell that the other folds have not foretells their mean.
    """
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


def _over(left: Left, variable: str, way: str) -> Array:
    """The signal itself; against the motion, the size of a speed."""
    signal = left.signals[variable]
    return np.abs(signal) if way == "-v" and variable.startswith(("v_", "gap")) else signal


def _edges(signal: Array, bins: int) -> Array:
    """Edges of bins with equally many samples."""
    return np.unique(np.quantile(signal, np.linspace(0, 1, bins + 1)))


def _cells(signal: Array, edges: Array) -> Index:
    return np.clip(np.searchsorted(edges, signal, side="right") - 1, 0, len(edges) - 2)


def _means(
    cell: Index, y: Array, stretch: Index, size: int, rng: np.random.Generator
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Mean of each cell with its 95 % interval, and whether enough stretches share it."""
    rows = int(stretch.max()) + 1
    at = stretch * size + cell
    counts = np.bincount(at, minlength=rows * size).reshape(rows, size).astype(float)
    sums = np.bincount(at, weights=y, minlength=rows * size).reshape(rows, size)
    mean = sums.sum(axis=0) / np.maximum(counts.sum(axis=0), 1)
    drawn = rng.multinomial(rows, np.full(rows, 1 / rows), size=SET.curve_draws)
    drawn_counts = drawn @ counts
    some = np.where(drawn_counts > 0, (drawn @ sums) / np.maximum(drawn_counts, 1e-300), mean)
    low, high = np.percentile(some, SET.curve_interval, axis=0)
    return mean, np.minimum(low, mean), np.maximum(high, mean), (counts > 0).sum(axis=0) >= SET.curve_least


def ranked(curves: Sequence[Curve | None]) -> tuple[Curve, ...]:
    """Those that are told, from the one that foretells most on; of a variable's two ways the better one."""
    told = sorted((c for c in curves if c is not None), key=lambda c: -c.share)
    best: dict[str, Curve] = {}
    for curve in told:
        best.setdefault(curve.variable, curve)
    return tuple(best.values())
