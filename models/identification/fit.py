"""Fitting a kind's parameters: least squares with wide secants or an ensemble, then a sampled polish; stick-slip makes the criterion jagged."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from models.effects import REFINEMENTS
from models.effects.effect import Effect
from models.identification.kind import Kind
from models.identification.sampling import Found, Space, evolve, gather, spread
from models.parameter import Parameter
from models.record import Record

_T = TypeVar("_T")
_R = TypeVar("_R")
Array = NDArray[np.float64]
_POOL = ThreadPoolExecutor(os.cpu_count() or 1)
_MARGIN = 1e-9
_WIDEST = 0.25
_PATIENT = (1e5, 1e4)
_SETTLING = (1e4, 3e3)
_NEAR_M = 3e-3
_SECANTS = (0.3, 0.1)
_FINE = 0.03


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
    known = {effect.id: effect for effect in _declared(kind)}
    for effect in (known[name] for name in effects):
        name = effect.id
        for p in (q for q in effect.parameters() if q.fit):
            scale = effect.probe if p.name == effect.amplitude().name else _scale(p)
            result.append(Axis(f"{name}.{p.name}", p, scale))
    return result


def _declared(kind: Kind) -> tuple[type[Effect], ...]:
    """Every effect that a fit of `kind` may be asked for: its candidates and the free curves."""
    return (*kind.effects, *REFINEMENTS)


def _scale(p: Parameter) -> float:
    return 0.1 * abs(p.value) if p.value else (p.upper - p.lower) / 600


def parallel(function: Callable[[_T], _R], items: Sequence[_T]) -> list[_R]:
    """`function` of every item on all processors; the compiled loops release the interpreter."""
    return list(_POOL.map(function, items)) if len(items) > 1 else [function(item) for item in items]


def evaluate(kind: Kind, records: Sequence[Record], theta: Mapping[str, float], stage: int) -> Array:
    """The residuals of all records at `theta`, one after the other."""
    return evaluate_all(kind, records, [theta], stage)[0]


def evaluate_all(kind: Kind, records: Sequence[Record], thetas: Sequence[Mapping[str, float]], stage: int) -> list[Array]:
    """`evaluate` at each of `thetas`, on all processors and in all their lanes."""
    groups = [thetas[i : i + kind.lanes] for i in range(0, len(thetas), kind.lanes)]
    tasks = [(record, group) for group in groups for record in records]
    parts = iter(parallel(lambda task: kind.residuals(*task, stage), tasks))
    rows: list[Array] = []
    for _ in groups:
        rows += [np.concatenate(row) for row in zip(*(next(parts) for _ in records), strict=True)]
    return rows


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
        return self.all_at([x])[0]

    def all_at(self, points: Sequence[Array]) -> list[Array]:
        """Residuals at each point: of the records, and of fitted parameters from what is believed of them."""
        rows = evaluate_all(self.kind, self.records, [self.theta(x) for x in points], self.stage)
        believed = [(i, a.parameter) for i, a in enumerate(self.axes) if np.isfinite(a.parameter.spread)]
        if not believed:
            return rows
        held = [[(x[i] - p.value) / p.spread for i, p in believed] for x in points]
        return [np.concatenate(pair) for pair in zip(rows, held, strict=True)]

    def jacobian(self, x: Array, secant: float) -> Array:
        points = []
        for i, step in enumerate(secant * self.scale):
            for sign in (1.0, -1.0):
                y = x.copy()
                y[i] = np.clip(x[i] + sign * step, self.lower[i], self.upper[i])
                points.append(y)
        values = self.all_at(points)
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
    """A sampled search around `fit` at `stage` (four generations of an evolution a round), shaped by the fit's Jacobian; then the
    Jacobian at the best point for the intervals. Never returns a point worse than the start."""
    problem = Problem(kind, records, axes(kind, effects), stage)
    x = problem.start(fit.theta)
    if len(x):
        space = _space(problem, fit.theta)
        slope = fit.jacobian * space.reach
        weight = 1 / max(fit.chi2, 1.0)
        root = spread(weight * slope.T @ slope, _PATIENT[-1], _WIDEST)
        r = problem.at(x)
        x = evolve(space, Found(x, float(r @ r), x, root, fit.jacobian), rng, 4 * rounds, 1.0).best
    r = problem.at(x)
    return Fit(problem.theta(x), float(r @ r), len(r), problem.jacobian(x, _FINE), r)


def _space(problem: Problem, start: Mapping[str, float]) -> Space:
    """Where a sampled search of `problem` looks: around the believed base and the effects' values in `start`."""
    count = sum(p.fit for p in problem.kind.base)
    x = problem.start(start)
    home = np.array([a.parameter.value if i < count else v for i, (a, v) in enumerate(zip(problem.axes, x, strict=True))])
    grids = {f"{e.id}.{name}": values for e in _declared(problem.kind) for name, values in e.grid.items()}
    amplitudes = {f"{e.id}.{e.amplitude().name}" for e in _declared(problem.kind)}
    reach = [
        0.25 * (a.parameter.upper - a.parameter.lower)
        if i < count
        else max(2 * a.scale, abs(float(v)))
        if a.name in amplitudes
        else _reach(a.parameter, float(v), grids.get(a.name, ()))
        for i, (a, v) in enumerate(zip(problem.axes, x, strict=True))
    ]
    return Space(problem.all_at, problem.lower, problem.upper, np.array(reach), home)


def _reach(p: Parameter, value: float, grid: Sequence[float]) -> float:
    """How far a shape's constant may be off at the start: half the way to the next value of its screening `grid`, if it has one."""
    if len(grid) > 1 and grid[0]:
        return min(0.5, 0.5 * (grid[1] / grid[0] - 1)) * abs(value)
    if p.unit == "rad":
        return 1.0
    if p.value:
        return 0.5 * abs(value) if value else 0.5 * abs(p.value)
    return _NEAR_M if p.unit == "m" else min(0.5, 0.25 * (p.upper - p.lower))


def anneal(
    kind: Kind, records: Sequence[Record], effects: Sequence[str], start: Mapping[str, float], steps: int = 12, seed: int = 0
) -> Fit:
    """The last stage's fit: where the kind has several stages by way of two ensembles, one that the observer keeps in step and one that
    runs free, the better of which shrinks on; else by least squares. Deterministic."""
    last = kind.stages - 1
    problem = Problem(kind, records, axes(kind, effects), last)
    x = problem.start(start)
    if not last or not len(x):
        theta = dict(start)
        for secant in _SECANTS:
            fit = descend(kind, records, effects, theta, last, secant, steps)
            theta = fit.theta
        return fit
    rng = np.random.default_rng(seed)
    space = _space(problem, start)
    clouds = []
    for stage in (min(1, last - 1), last):
        found = Found(x, np.inf, x, _WIDEST * np.eye(len(x)), np.zeros((0, len(x))))
        found = gather(_space(replace(problem, stage=stage), start), found, rng, _PATIENT, steps, _WIDEST)
        ends = [found.best, found.mean]
        found.best, found.cost = x, np.inf
        found.take(ends, np.array([float(r @ r) for r in space.residuals(ends)]))
        clouds.append(found)
    found = min(clouds, key=lambda cloud: cloud.cost)
    found = gather(space, found, rng, _SETTLING, steps // 2, _WIDEST)
    r = problem.at(found.best)
    return Fit(problem.theta(found.best), float(r @ r), len(r), found.slope, r)
