"""Fitting a kind's parameters: least squares with ever narrower secants, for stick-slip makes the criterion jagged."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from models.assembly.model import effect_parameters
from models.effects import REFINEMENTS
from models.identification.fitting.gauss_newton import GaussNewton
from models.identification.kind import Array, Kind
from models.identification.settings import SET
from models.parameter import Name, Parameter
from models.records.record import Record
from models.theta import Theta

_T = TypeVar("_T")
_R = TypeVar("_R")
_POOL = ThreadPoolExecutor(os.cpu_count() or 1)


@dataclass(frozen=True)
class FreeParameter:
    """One fitted parameter, and the scale of its secants."""

    parameter: Parameter
    scale: float

    @property
    def name(self) -> Name:
        """The key of its value."""
        return self.parameter.key


@dataclass(frozen=True)
class Fit:
    """A fitted point: values, cost (sum of squares), number of residuals, Jacobian in the axes' order."""

    theta: Theta
    cost: float
    count: int
    jacobian: Array
    residual: Array

    @property
    def chi2(self) -> float:
        """Cost for each residual, about 1 where the model is right."""
        return self.cost / self.count


def axes(kind: Kind, effects: Sequence[str]) -> list[FreeParameter]:
    """The fitted parameters of `kind` with `effects`; the scale is a tenth of the value, of an amplitude its probe."""
    result = [FreeParameter(p, _scale(p)) for p in kind.base if p.fit]
    known = {effect.id: effect for effect in (*kind.effects, *REFINEMENTS)}
    for effect in (known[name] for name in effects):
        size = effect.amplitude().name
        own = (p for p in effect_parameters([effect]) if p.fit)
        result += [FreeParameter(p, effect.probe if p.name == size else _scale(p)) for p in own]
    return result


def _scale(p: Parameter) -> float:
    return 0.1 * abs(p.value) if p.value else (p.upper - p.lower) / 600


def parallel(function: Callable[[_T], _R], items: Sequence[_T]) -> list[_R]:
    """`function` of every item on all processors; the compiled loops release the interpreter."""
    return list(_POOL.map(function, items)) if len(items) > 1 else [function(item) for item in items]


def evaluate(kind: Kind, records: Sequence[Record], theta: Theta, criterion: int) -> Array:
    """The residuals of all records at `theta`, one after the other."""
    return evaluate_all(kind, records, [theta], criterion)[0]


def evaluate_all(kind: Kind, records: Sequence[Record], thetas: Sequence[Theta], criterion: int) -> list[Array]:
    """`evaluate` at each of `thetas`, on all processors and in all their lanes."""
    groups = [thetas[i : i + kind.lanes] for i in range(0, len(thetas), kind.lanes)]
    tasks = [(record, group) for group in groups for record in records]
    parts = iter(parallel(lambda task: kind.residuals(*task, criterion), tasks))
    rows: list[Array] = []
    for _ in groups:
        rows += [np.concatenate(row) for row in zip(*(next(parts) for _ in records), strict=True)]
    return rows


def costs_of(kind: Kind, records: Sequence[Record], thetas: Sequence[Theta], criterion: int) -> list[float]:
    """Sum of squares of the residuals at each of `thetas`."""
    return [float(r @ r) for r in evaluate_all(kind, records, thetas, criterion)]


@dataclass(frozen=True)
class Problem:
    """Regularised least squares: residuals of `records` under a `criterion` of `kind`, in their noise, over `axes`."""

    kind: Kind
    records: Sequence[Record]
    axes: list[FreeParameter]
    criterion: int

    @classmethod
    def of(cls, kind: Kind, records: Sequence[Record], effects: Sequence[str], criterion: int | None = None) -> Problem:
        """The fit of the base with `effects`; without a criterion to the free run."""
        return cls(kind, records, axes(kind, effects), kind.free_run if criterion is None else criterion)

    @cached_property
    def solver(self) -> GaussNewton:
        """The Gauss-Newton search on these residuals."""
        lower, upper, scale = (
            np.array(row)
            for row in (
                [a.parameter.lower for a in self.axes],
                [a.parameter.upper for a in self.axes],
                [a.scale for a in self.axes],
            )
        )
        return GaussNewton(self.all_at, lower, upper, scale, max(4, 2 * self.kind.lanes))

    def theta(self, x: Array) -> Theta:
        """The parameters by name at the point `x` (n,)."""
        return Theta.of((a.name, float(v)) for a, v in zip(self.axes, x, strict=True))

    def start(self, theta: Theta) -> Array:
        """The point (n,) of `theta`, within the bounds; declared values where it has none."""
        return self.solver.clip(np.array([theta.get(a.name, a.parameter.value) for a in self.axes]))

    def all_at(self, points: Sequence[Array]) -> list[Array]:
        """Residuals at each point: of the records, and of the parameters that have a prior."""
        rows = evaluate_all(self.kind, self.records, [self.theta(x) for x in points], self.criterion)
        priors = [(i, a.parameter) for i, a in enumerate(self.axes) if np.isfinite(a.parameter.spread)]
        if not priors:
            return rows
        own = [[(x[i] - p.value) / p.spread for i, p in priors] for x in points]
        return [np.concatenate(pair) for pair in zip(rows, own, strict=True)]

    def jacobian(self, x: Array, secant: float) -> Array:
        """Derivatives of the residuals (m, n) at `x`, as secants `secant` scales wide to either side."""
        points = []
        for i, step in enumerate(secant * self.solver.scale):
            for sign in (1.0, -1.0):
                y = x.copy()
                y[i] = np.clip(x[i] + sign * step, self.solver.lower[i], self.solver.upper[i])
                points.append(y)
        values = self.all_at(points)
        columns = [
            (values[2 * i] - values[2 * i + 1]) / max(points[2 * i][i] - points[2 * i + 1][i], 1e-300)
            for i in range(len(x))
        ]
        return np.array(columns).T

    def descend(self, start: Theta, secant: float, steps: int) -> Fit:
        """Least squares in at most `steps` rounds, derivatives as secants `secant` wide that look across jags."""
        x0 = self.start(start)
        if not len(x0):
            (r,) = self.all_at([x0])
            return Fit(Theta(), float(r @ r), len(r), np.zeros((len(r), 0)), r)
        end = self.solver.descend(x0, secant, steps)
        return Fit(self.theta(end.x), end.cost, len(end.residual), end.jacobian, end.residual)

    def narrowing(self, start: Theta, widths: Sequence[float] = SET.narrow, steps: int = 12) -> Fit:
        """Descents one after the other, with secants of `widths`."""
        for width in widths:
            fit = self.descend(start, width, steps)
            start = fit.theta
        return fit
