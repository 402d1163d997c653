"""A spline of one input fitted inside the simulation, on the validation blocks; the proposed term follows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from models.effects import shapes
from models.effects.effect import Effect, Signals, Values, number
from models.effects.own import Origin
from models.identification.finding import Dependence, ResidualCurve
from models.identification.fitting.fit import Fit
from models.identification.fitting.fitter import Fitter
from models.identification.fitting.horizon import lengths
from models.identification.intervals import memory
from models.identification.kind import Array
from models.identification.kinds.reports import AnyKind
from models.identification.residual_term import SYMBOLS, term_of
from models.identification.search.fitted_model import FittedModel
from models.identification.search.search import Search
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta
from models.workers import each

ID = "spline_of_the_residual"


def followed_inside(kind: AnyKind, found: Search, train: Sequence[Record], dependence: Dependence) -> Dependence:
    """`dependence` with the term of that spline which, fitted beside all else, predicts the validation blocks best;
    over one of the variables whose curves predict most of the residual, however little: a wrong model loses slip
    events, which hides them. As it is where no spline gains, or the residual is no force.
    """
    level, splits = dependence.level, kind.splits(kind.searched(train))
    curves = [curve for curve in dependence.curves if curve.variable in SYMBOLS][: SET.spline_tried]
    if not (level and curves and found.parts):
        return dependence
    plain = FittedModel(kind, splits, tuple(found.model), tuple(theta for _, theta in found.parts))
    tried = [_Inner.of(kind, found.model, curve, level) for curve in curves]
    fits = each(lambda one: one.fits(plain), tried)
    costs = [one.model(plain, thetas).cost for one, thetas in zip(tried, fits, strict=True)]
    best, cost = min(zip(tried, costs, strict=True), key=lambda row: row[1])
    if cost > plain.cost - SET.least_drop:
        return dependence
    curve = best.curve_on(train, found.augmented.theta)
    return replace(dependence, term=term_of(curve, dependence.unit, level), inside=(plain.cost, cost))


@dataclass(frozen=True)
class _Inner:
    """A `kind` with the spline over a `curve`'s variable as an effect, at `places` (n,) along it, beside those of the
    `named` model; `unit_N` is the force of a height of 1: the mean resistance where it scales that.
    """

    kind: AnyKind
    named: tuple[str, ...]
    curve: ResidualCurve
    places: Array
    unit_N: float

    @classmethod
    def of(cls, kind: AnyKind, named: Sequence[str], curve: ResidualCurve, level: float) -> _Inner:
        places = np.unique(np.quantile(curve.centres, np.linspace(0, 1, min(SET.spline_knots, len(curve.centres)))))
        against = curve.along == "-v"
        most = 1.0 if against else 5 * level
        effect = _effect(kind.name, curve, places, most)
        catalogue = replace(kind.catalogue, own=(*kind.catalogue.own, Origin(effect, "", ID)))
        wide: AnyKind = replace(kind, effects=(*kind.effects, effect), catalogue=catalogue)
        return cls(wide, (*named, ID), curve, places, level if against else 1.0)

    @property
    def heights(self) -> dict[str, float]:
        """Those of the residual's curve."""
        values = np.interp(self.places, self.curve.centres, self.curve.values) / self.unit_N
        effect = self.kind.declared(ID)
        rows = zip(effect.parameters(), values, strict=True)
        return {p.name: float(np.clip(value, 0.9 * p.lower, 0.9 * p.upper)) for p, value in rows}

    def fits(self, plain: FittedModel) -> list[Theta]:
        """`plain` with the spline, fitted to the training part of each split."""
        return [self.fit(part, theta).theta for part, theta in plain.parts]

    def model(self, plain: FittedModel, thetas: Sequence[Theta]) -> FittedModel:
        return replace(plain, kind=self.kind).fitted(thetas, self.named)

    def fit(self, records: Sequence[Record], theta: Theta, criterion: int | None = None) -> Fit:
        """On growing prefixes of `records`, from the residual's curve."""
        theta = theta.with_(ID, self.heights)
        for _, part in lengths(self.kind, records):
            fit = Fitter.of(self.kind, part, self.named, criterion).near(theta, SET.narrow, SET.rounds)
            theta = fit.theta
        return fit

    def curve_on(self, records: Sequence[Record], theta: Theta) -> ResidualCurve:
        """The spline fitted to all `records`, with 95 % intervals beside their mean, which the base may have."""
        fit = self.fit(records, theta, self.kind.final)
        values = np.array([fit.theta[ID, name] for name in self.heights])
        wide, count = max(fit.chi2, 1.0) * memory(fit.residual), len(values)
        covariance = np.linalg.pinv(fit.jacobian.T @ fit.jacobian, rcond=SET.tiny)[-count:, -count:] * wide
        centred = np.eye(count) - 1 / count
        half = SET.z95 * np.sqrt(np.maximum(np.diag(centred @ covariance @ centred), 0.0))
        values, half = self.unit_N * values, self.unit_N * half
        return replace(self.curve, centres=self.places, values=values, low=values - half, high=values + half)


def _effect(kind: str, curve: ResidualCurve, places: Array, most: float) -> type[Effect]:
    """A factor on the resistance, or a force, straight between heights at `places` of the curve's variable."""
    against = curve.along == "-v"
    names, signal = [f"height_{k}" for k in range(len(places))], SYMBOLS[curve.variable][1]

    def spline(self: Effect, s: Signals, p: Values, z: Values) -> Any:
        over = s.command - s.x if " - " in signal else getattr(s, signal.removeprefix("s."))
        heights = shapes.knots(np.abs(over) if curve.sized else over, places.tolist(), [p[name] for name in names])
        return 1 + heights if against else heights

    space: dict[str, Any] = {
        "__doc__": "A spline of one input.",
        "id": ID,
        "kinds": frozenset({kind}),
        "probe": 0.05 * most,
        **{name: number(0.0, "1" if against else "N", -most, 3 * most) for name in names},
        "level" if against else "force": spline,
    }
    return type("Spline", (Effect,), space)
