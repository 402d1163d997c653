"""Confidence intervals of fitted parameters."""

from collections.abc import Sequence
from itertools import takewhile

import numpy as np

from models.identification.finding import Fitted
from models.identification.fitting.fit import Fit, axes
from models.identification.kind import Array, Kind
from models.identification.settings import SET
from models.parameter import Name, Parameter
from models.theta import Theta

Part = tuple[float, Theta]
"""Share of the records' rows that a fit was made on, and its values."""


def intervals(kind: Kind, fit: Fit, effects: Sequence[str], parts: Sequence[Part] = ()) -> dict[Name, Fitted]:
    """95 % intervals, within the bounds: the widest of least squares' own, widened for a residual beyond chance or not
    independent, of the sandwich with the scores' scatter from block to block, which holds for a model that is not quite
    right, and of the jackknife, by which the fits on `parts` of the records differ from the one on all.
    """
    fitted = axes(kind, effects)
    if not fitted:
        return {}
    scale = np.array([a.scale for a in fitted])
    variance = np.max([np.diag(covariance) for covariance in _covariances(fit, scale)], axis=0)
    out = {}
    for axis, deviation in zip(fitted, np.sqrt(variance) * scale, strict=True):
        value = fit.theta[axis.name]
        p = axis.parameter
        moved = jackknife(value, [(share, theta[axis.name]) for share, theta in parts if axis.name in theta], p.unit)
        unsure = np.hypot(max(deviation, moved), kind.scale_std(p) * abs(value))
        half = float(np.hypot(SET.z95 * unsure, SET.accuracy * abs(value)))
        held = any(near(value, bound, p) for bound in (p.lower, p.upper))
        identifiable = half < SET.vague * max(abs(value), axis.scale) + axis.scale and not held
        out[axis.name] = Fitted(value, (max(value - half, p.lower), min(value + half, p.upper)), p.unit, identifiable)
    return out


def _covariances(fit: Fit, scale: Array) -> tuple[Array, Array]:
    """Covariance of the fitted values in units of `scale`, shape (p, p): least squares' own, by noise alone the inverse
    of J'J, widened for a misfit beyond chance and for residuals that are not independent, and the sandwich.
    """
    rows = fit.jacobian * scale
    inverse = inverse_of(rows)
    count = min(SET.bootstrap_blocks, len(rows))
    pairs = zip(np.array_split(rows, count), np.array_split(fit.residual, count), strict=True)
    scores = np.array([part.T @ r for part, r in pairs])
    scatter = len(scores) / max(len(scores) - len(scale), 1) * scores.T @ scores
    return inverse * max(fit.chi2, 1.0) * memory(fit.residual), inverse @ scatter @ inverse


def inverse_of(rows: Array) -> Array:
    """The inverse of `rows' rows` (p, p), rows (m, p); directions without effect count as little as rounding."""
    squares, vectors = np.linalg.eigh(rows.T @ rows)
    return np.asarray((vectors / np.maximum(squares, SET.tiny * max(squares[-1:].sum(), SET.tiny))) @ vectors.T)


def jackknife(value: float, parts: Sequence[tuple[float, float]], unit: str = "1") -> float:
    """Standard deviation of `value`, found on all rows, from those found on shares s of them: `(mean of d^2 s/(1 -
    s))^(1/2)`, d how far off a part's value is, angles the shorter way round. With one group left out in turn this is
    the delete-a-group jackknife.
    """
    away = [(share, part - value) for share, part in parts if share < 1]
    if unit == "rad":
        away = [(share, (d + np.pi) % (2 * np.pi) - np.pi) for share, d in away]
    return float(np.sqrt(np.mean([d * d * share / (1 - share) for share, d in away]))) if away else 0.0


def gain_beyond(fit: Fit, k: int) -> float:
    """Share of the cost of `fit` that its k-th parameter takes off beyond its bound, others refitted: linearised."""
    others, column = np.delete(fit.jacobian, k, 1), fit.jacobian[:, k]
    scale = np.linalg.norm(others, axis=0) + SET.tiny
    own = column - others @ (np.linalg.lstsq(others / scale, column)[0] / scale)
    return float((own @ fit.residual) ** 2 / max(float(own @ own) * fit.cost, SET.tiny))


def near(value: float, bound: float, p: Parameter) -> bool:
    """Whether `value` stands at the `bound` of `p`: within 0.1 % of itself, or 1e-6 of the range."""
    spread = p.upper - p.lower
    margin = max(SET.at_bound * min(spread, max(abs(value), abs(bound))) * (bound != 0), SET.at_bound**2 * spread)
    return bool(np.isfinite(bound) and abs(value - bound) <= (margin if np.isfinite(margin) else 0.0))


def memory(residual: np.ndarray) -> float:
    """Samples of a residual that count as one: 1 + 2 sum of the autocorrelation until it dies out."""
    r, n = residual - residual.mean(), len(residual)
    power = max(float(r @ r), np.finfo(float).tiny)
    rho = (float(r[:-lag] @ r[lag:]) / power for lag in range(1, min(SET.memory_lags, n // 4)))
    return 1.0 + 2 * sum(takewhile(lambda one: one >= SET.memoryless, rho))
