"""Fitting a kind's parameters: annealed least squares with wide secants, then a sampled polish; stick-slip makes the criterion jagged."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from models.identification.kind import Kind
from models.parameter import Parameter
from models.record import Record

_T = TypeVar("_T")
_R = TypeVar("_R")
Array = NDArray[np.float64]
_POOL = ThreadPoolExecutor(os.cpu_count() or 1)
_MARGIN = 1e-9
_WIDEST = 0.3
_SECANTS = (0.3, 0.1)


@dataclass(frozen=True)
class Axis:
    """One fitted parameter: full name, declaration, and the scale on which the criterion is looked at."""

    name: str
    parameter: Parameter
    scale: float


@dataclass(frozen=True)
class Fit:
    """A fitted point: values, cost (sum of squares), number of residuals, Jacobian in the axes' order."""

    theta: dict[str, float]
    cost: float
    count: int
    jacobian: Array
    residual: Array

    @property
    def chi2(self) -> float:
        """Cost for each residual, about 1 where the model is right."""
        return self.cost / self.count


def axes(kind: Kind, effects: Sequence[str]) -> list[Axis]:
    """What a fit of `kind` with `effects` may move. A tenth of a value is its scale; an amplitude's is the effect's probe."""
    result = [Axis(p.name, p, _scale(p)) for p in kind.base if p.fit]
    declared = {effect.id: effect for effect in kind.effects}
    for effect in (declared[name] for name in effects):
        name = effect.id
        for p in (q for q in effect.parameters() if q.fit):
            scale = effect.probe if p.name == effect.amplitude().name else _scale(p)
            result.append(Axis(f"{name}.{p.name}", p, scale))
    return result


def _scale(p: Parameter) -> float:
    return 0.1 * abs(p.value) if p.value else (p.upper - p.lower) / 600


def parallel(function: Callable[[_T], _R], items: Sequence[_T]) -> list[_R]:
    """`function` of every item on all processors; the compiled loops release the interpreter."""
    return list(_POOL.map(function, items)) if len(items) > 1 else [function(item) for item in items]


def evaluate(kind: Kind, records: Sequence[Record], theta: Mapping[str, float], stage: int) -> Array:
    """The residuals of all records at `theta`, one after the other."""
    return np.concatenate([kind.residual(record, theta, stage) for record in records])


@dataclass(frozen=True)
class Problem:
    kind: Kind
    records: Sequence[Record]
    axes: list[Axis]
    stage: int

    @property
    def lower(self) -> Array:
        return np.array([a.parameter.lower for a in self.axes])

    @property
    def upper(self) -> Array:
        return np.array([a.parameter.upper for a in self.axes])

    @property
    def scale(self) -> Array:
        return np.array([a.scale for a in self.axes])

    def theta(self, x: Array) -> dict[str, float]:
        return {a.name: float(v) for a, v in zip(self.axes, x, strict=True)}

    def start(self, theta: Mapping[str, float]) -> Array:
        span = np.where(np.isfinite(self.upper - self.lower), self.upper - self.lower, 1.0) * _MARGIN
        return np.clip([theta.get(a.name, a.parameter.value) for a in self.axes], self.lower + span, self.upper - span)

    def at(self, x: Array) -> Array:
        return evaluate(self.kind, self.records, self.theta(x), self.stage)

    def jacobian(self, x: Array, secant: float) -> Array:
        points = []
        for i, step in enumerate(secant * self.scale):
            for sign in (1.0, -1.0):
                y = x.copy()
                y[i] = np.clip(x[i] + sign * step, self.lower[i], self.upper[i])
                points.append(y)
        values = parallel(self.at, points)
        columns = [
            (values[2 * i] - values[2 * i + 1]) / max(points[2 * i][i] - points[2 * i + 1][i], 1e-300) for i in range(len(x))
        ]
        return np.array(columns).T


def descend(
    kind: Kind,
    records: Sequence[Record],
    effects: Sequence[str],
    start: Mapping[str, float],
    stage: int,
    secant: float,
    steps: int,
) -> Fit:
    """Least squares within bounds at one stage, derivatives as central secants `secant` scales wide that look across the jags."""
    problem = Problem(kind, records, axes(kind, effects), stage)
    x0 = problem.start(start)
    if not len(x0):
        r = problem.at(x0)
        return Fit({}, float(r @ r), len(r), np.zeros((len(r), 0)), r)
    solution = least_squares(
        problem.at,
        x0,
        jac=lambda x: problem.jacobian(x, secant),
        bounds=(problem.lower, problem.upper),
        x_scale=problem.scale,
        max_nfev=steps,
        ftol=1e-4,
        xtol=1e-5,
    )
    return Fit(problem.theta(solution.x), 2 * float(solution.cost), len(solution.fun), solution.jac, solution.fun)


def polish(
    kind: Kind,
    records: Sequence[Record],
    effects: Sequence[str],
    fit: Fit,
    stage: int,
    rng: np.random.Generator,
    rounds: int = 10,
) -> Fit:
    """A sampled search around `fit` at `stage`: proposals shaped by the Gauss-Newton covariance, the best quarter of each round shapes
    the next; then the Jacobian at the best point for the intervals. Never returns a point worse than the start.
    """
    problem = Problem(kind, records, axes(kind, effects), stage)
    n = len(problem.axes)
    best = problem.start(fit.theta)
    r = problem.at(best)
    cost, mean = float(r @ r), best.copy()
    covariance = _proposal(fit.jacobian, problem.scale)
    size = 8 + 2 * n
    for _ in range(rounds):
        draws = rng.multivariate_normal(mean, covariance, size, method="eigh")
        points = [np.clip(x, problem.lower, problem.upper) for x in draws]
        costs = np.array([float(v @ v) for v in parallel(problem.at, points)])
        order = np.argsort(costs)[: max(3, size // 4)]
        if costs[order[0]] < cost:
            cost, best = float(costs[order[0]]), points[order[0]]
        elite = np.array([points[i] for i in order] + [best])
        mean = 0.5 * best + 0.5 * elite.mean(axis=0)
        spread = elite - mean
        covariance = 0.4 * covariance + 0.6 * (spread.T @ spread / len(elite))
    jacobian = problem.jacobian(best, 0.003)
    r = problem.at(best)
    return Fit(problem.theta(best), float(r @ r), len(r), jacobian, r)


def _proposal(jacobian: Array, scale: Array) -> Array:
    """A covariance with the Gauss-Newton shape whose widest axis is a third of a scale; at least a thirtieth along each parameter."""
    J = jacobian * scale
    values, vectors = np.linalg.eigh(J.T @ J + 1e-12 * np.eye(len(scale)))
    spread = np.clip(np.sqrt(values[0] / values) * _WIDEST, _WIDEST / 10, _WIDEST)
    root = scale[:, None] * vectors * spread
    return np.asarray(root @ root.T)


def anneal(kind: Kind, records: Sequence[Record], effects: Sequence[str], start: Mapping[str, float], steps: int = 12) -> Fit:
    """Through the kind's stages, from the one that forgets fast to the free run, warm from stage to stage; the last stage's fit."""
    fit = None
    theta = dict(start)
    for stage in range(kind.stages):
        for secant in _SECANTS if stage == 0 else _SECANTS[1:]:
            fit = descend(kind, records, effects, theta, stage, secant, steps)
            theta = fit.theta
    assert fit is not None
    return fit
