"""Which record of a series disagrees with the others, and by which parameter or effect."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np
import scipy

from models.identification.finding import Disagreement
from models.identification.fitting.fit import Fit, FreeParameter, axes, evaluate
from models.identification.fitting.fitter import Fitter
from models.identification.fitting.horizon import lengths
from models.identification.intervals import memory
from models.identification.kind import Array, Kind
from models.identification.search.screening import screen
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta, spelled
from models.words.quantities import measured_unit
from models.workers import each


def disagreements(kind: Kind, fit: Fit, model: Sequence[str], records: Sequence[Record]) -> tuple[Disagreement, ...]:
    """The records that disagree with the others of the `fit` of `kind` with the effects of `model`, the clearest first.
    Each in turn is left out of a fit, and gets a value of its own of one parameter, or of the amplitude of one further
    effect. One that disagrees stays out, and the others are compared again.
    """
    found: list[Disagreement] = []
    series, theta = list(records), fit.theta
    while len(series) > 1 and (row := _clearest(kind, model, series, theta)) is not None:
        record, theta, one = row
        found.append(one)
        series.remove(record)
    return tuple(found)


def _clearest(
    kind: Kind, model: Sequence[str], records: Sequence[Record], theta: Theta
) -> tuple[Record, Theta, Disagreement] | None:
    """The record that disagrees with the others most, the fit to these, and by what. Of three and more it is one of
    those that the common fit misses most, of which a fit without it leaves the noise where slip events may be missed.
    """
    rows = [evaluate(kind, [record], theta, kind.final) for record in records]
    cost, beyond = sum(float(r @ r) for r in rows), [max(float(r @ r) - len(r), 0.0) for r in rows]
    if sum(beyond) < SET.unseen * sum(map(len, rows)):
        return None
    sizes = [float(r @ r) / len(r) for r in rows]
    least = np.median(sizes) if len(records) > 2 else 0.0
    likely = [(one, r) for one, r, size in zip(records, rows, sizes, strict=True) if size >= least]
    parts = [[other for other in records if other is not record] for record, _ in likely]
    fits = each(lambda part: Fitter.of(kind, part, model, kind.final).near(theta).bare(), parts)
    tried = [
        _Own(kind, tuple(model), record, part, fit, r, cost)
        for (record, r), part, fit in zip(likely, parts, fits, strict=True)
        if not (kind.beginnings_s and fit.chi2 > SET.near)
    ]
    tried = sorted(tried, key=attrgetter("most"), reverse=True)[: SET.disagree_tried]
    found = [(own.record, own.rest.theta, one) for own in tried if own.most > 0 and (one := own.found(len(records)))]
    return max(found, key=lambda row: row[2].standard_deviations, default=None)


@dataclass(frozen=True)
class _Own:
    """A `record` with a value of its own beside the fit `rest` of the `others`; `residual` is that of the record in the
    fit of all, which costs `all`.
    """

    kind: Kind
    model: tuple[str, ...]
    record: Record
    others: Sequence[Record]
    rest: Fit
    residual: Array
    all: float

    @property
    def most(self) -> float:
        """What it takes off the cost at most: all of the record's beyond noise."""
        return self.all - self.rest.cost - len(self.residual)

    def found(self, count: int) -> Disagreement | None:
        """What the record disagrees by, a parameter or an effect that shows most in it; None for chance."""
        kind, here = self.kind, self.rest.theta
        candidates = [(axis, self.model, here) for axis in axes(kind, self.model)]
        screened = screen(kind, [self.record], self.model, here)
        for row in screened[: SET.final]:
            more, size = (*self.model, row.effect), kind.declared(row.effect).amplitude().name
            own = next(axis for axis in axes(kind, more) if axis.name == (row.effect, size))
            candidates += [(own, more, here.with_(row.effect, start)) for start in row.starts[:1]]
        fits = each(lambda one: self._fit(*one), candidates)
        rows = sorted(zip(fits, candidates, strict=True), key=lambda row: row[0].cost)
        tests = count * (len(candidates) + len(screened))
        told = (self._told(fit, axis, model, tests) for fit, (axis, model, _) in rows[: SET.final])
        return next(filter(None, told), None)

    def _fit(self, axis: FreeParameter, model: tuple[str, ...], start: Theta) -> Fit:
        """The record fitted by one value alone: over a wide range on its beginning, ever closer on longer parts."""
        p, whole = axis.parameter, Fitter.of(self.kind, [self.record], model, self.kind.final)
        width, best = SET.disagree_reach * axis.scale, [start[axis.name], self._value(axis)]
        for _, parts in lengths(self.kind, [self.record]):
            steps = width * np.linspace(-1, 1, SET.disagree_points)
            values = np.unique(np.clip(np.add.outer(best, steps), p.lower, p.upper))
            part = replace(whole, records=parts)
            found = part.lowest([start | {axis.name: float(value)} for value in values], SET.final)
            best, width = [theta[axis.name] for theta in found], width / SET.disagree_closer
        return replace(whole, axes=[axis]).near(start | {axis.name: best[0]}, SET.fine, SET.rounds)

    def _value(self, axis: FreeParameter) -> float:
        return self.rest.theta.get(axis.name, 0.0)

    def _within_accuracy(self) -> float:
        """The record's cost where each parameter is the others' within the accuracy of a minimum."""
        narrow = []
        for axis in axes(self.kind, self.model):
            p, at = axis.parameter, self._value(axis)
            low, high = max(at - SET.accuracy * abs(at), p.lower), min(at + SET.accuracy * abs(at), p.upper)
            if low < high:
                narrow.append(replace(axis, parameter=replace(p, value=at, lower=low, upper=high)))
        if not narrow:
            return np.inf
        fitter = replace(Fitter.of(self.kind, [self.record], self.model, self.kind.final), axes=narrow)
        least, most = np.array([(axis.parameter.lower, axis.parameter.upper) for axis in narrow]).T
        draws = np.random.default_rng(0).uniform(least, most, (SET.near_by, len(narrow)))
        points = [self.rest.theta | {a.name: float(v) for a, v in zip(narrow, row, strict=True)} for row in draws]
        some = [self.rest.theta, *fitter.lowest(points, SET.final)]
        return min(each(lambda theta: fitter.near(theta, SET.fine, SET.rounds).cost, some))

    def _told(self, fit: Fit, axis: FreeParameter, model: tuple[str, ...], tests: int) -> Disagreement | None:
        """The disagreement of a `fit`; None where the gain may be chance, is small, or may be had by all records. Where
        fits may miss slip events, a part that is not fitted to the noise shows nothing.
        """
        count, p = len(self.residual), axis.parameter
        if self.kind.beginnings_s and max(self.rest.chi2, fit.cost / count) > SET.near:
            return None
        beyond = float(self.residual @ self.residual) - count
        alike = max(fit.cost / count, 1.0) * memory(fit.residual[:count])
        limit = np.sqrt(scipy.special.chdtri(1, SET.disagrees_by_chance / tests))
        value, at = fit.theta[axis.name], self._value(axis)

        def half(common: float) -> float:
            """That of the shift's 95 % interval beside the `common` fit; infinite where too little is gained."""
            gain = common - self.rest.cost - fit.cost
            if gain < max(SET.disagrees * beyond, SET.unseen * count):
                return np.inf
            return float(np.hypot(SET.z95 * abs(value - at) * np.sqrt(alike / gain), SET.accuracy * abs(at)))

        least = abs(value - at) * SET.z95 / limit
        same = evaluate(self.kind, self.others, fit.theta, self.kind.final)
        if half(min(self.all, float(same @ same) + fit.cost)) > least:
            return None
        whole = [*self.others, self.record]
        starts = ((self.model, self.rest.theta), (model, fit.theta))
        again = each(lambda row: Fitter.of(self.kind, whole, row[0], self.kind.final).near(row[1]).cost, starts)
        if (wide := half(min(self.all, *again, self.rest.cost + self._within_accuracy()))) > least:
            return None
        by = p.effect if p.effect not in ("", *self.model) else spelled(p.key)
        shift, unit = value - at, measured_unit(p.unit, self.kind.unit)
        z = SET.z95 * abs(shift) / wide
        return Disagreement(self.record.name, by, shift, (shift - wide, shift + wide), unit, z)
