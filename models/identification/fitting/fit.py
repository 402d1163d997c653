"""Residuals of records at many points, fitted parameters, and fits as values."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from models.assembly.model import effect_parameters
from models.effects import REFINEMENTS
from models.identification.kind import Array, Kind
from models.identification.settings import SET
from models.parameter import Name, Parameter
from models.records.record import Record
from models.theta import Theta


@dataclass(frozen=True)
class FreeParameter:
    """One fitted parameter, and the scale of its secants."""

    parameter: Parameter
    scale: float

    @property
    def name(self) -> Name:
        """The key of its value."""
        return self.parameter.key

    def on_side_of(self, start: Theta) -> "FreeParameter":
        """The same on the side of zero where it is at `start`, above its `least` size, below which it is another."""
        p = self.parameter
        if not p.least:
            return self
        low, high = (p.least, p.upper) if start.get(p.key, p.value) >= 0 else (p.lower, -p.least)
        return replace(self, parameter=replace(p, lower=low, upper=high, value=float(np.clip(p.value, low, high))))


@dataclass(frozen=True)
class Fit:
    """A fitted point: values, cost (sum of squares), number of residuals, Jacobian in the axes' order, residuals."""

    theta: Theta
    cost: float
    count: int
    jacobian: Array
    residual: Array

    @property
    def chi2(self) -> float:
        """Cost for each residual, about 1 where the model is right."""
        return self.cost / self.count

    @property
    def by_chance(self) -> bool:
        """Whether noise alone may cause the cost."""
        return bool(self.cost <= scipy.special.chdtri(self.count, 1 - SET.right_leaves))

    def bare(self) -> "Fit":
        """The fit without Jacobian and residuals, which are large."""
        return replace(self, jacobian=self.jacobian[:0], residual=self.residual[:0])


def axes(kind: Kind, effects: Sequence[str]) -> list[FreeParameter]:
    """The fitted parameters of `kind` with `effects`; the scale is a share of the value, of an amplitude its probe."""
    result = [FreeParameter(p, _scale(p)) for p in kind.base if p.fit]
    known = {effect.id: effect for effect in (*kind.effects, *REFINEMENTS)}
    for effect in (known[name] for name in effects):
        size = effect.amplitude().name
        own = (p for p in effect_parameters([effect]) if p.fit)
        result += [FreeParameter(p, effect.probe if p.name == size else _scale(p)) for p in own]
    return result


def _scale(p: Parameter) -> float:
    return float(SET.scale * abs(p.value) if p.value else SET.scale_of_range * (p.upper - p.lower))


def evaluate(kind: Kind, records: Sequence[Record], theta: Theta, criterion: int) -> Array:
    """The residuals (m,) of all records at `theta`, one record after the other."""
    return np.asarray(evaluate_all(kind, records, [theta], criterion)[0])


def evaluate_all(kind: Kind, records: Sequence[Record], thetas: Sequence[Theta], criterion: int) -> Array:
    """`evaluate` at each of `thetas`, (P, m)."""
    return np.hstack([kind.stacked(record, thetas, criterion) for record in records])


def mean_squares(residual: Array, least: int = 1) -> list[float]:
    """Mean square in each of up to forty blocks of `least` numbers or more."""
    parts = np.array_split(residual, int(np.clip(len(residual) // least, 1, SET.blocks)))
    return [float(part @ part) / len(part) for part in parts]


def judged(kind: Kind, records: Sequence[Record], theta: Theta) -> Array:
    """`mean_squares` of the residuals, under the kind's judge that suits each block better."""
    rows = [mean_squares(evaluate(kind, records, theta, criterion)) for criterion in kind.judges]
    return np.asarray(np.min(rows, axis=0))


def judged_cost(kind: Kind, records: Sequence[Record], theta: Theta) -> float:
    """Mean of the blocks."""
    return float(judged(kind, records, theta).mean())
