"""One way to fit: from close by, or from anywhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter

import numpy as np

from models.effects import REFINEMENTS
from models.identification.fitting.fit import Fit, FreeParameter, axes, evaluate_all, judged_cost
from models.identification.fitting.gauss_newton import GaussNewton
from models.identification.fitting.horizon import lengths, scattered
from models.identification.kind import Array, Kind
from models.identification.settings import SET
from models.parameter import Parameter
from models.records.record import Record
from models.theta import Theta
from models.workers import each


@dataclass(frozen=True)
class Fitter:
    """Regularised least squares of one model: residuals of `records` under a `criterion` of `kind`, in their noise,
    over `axes`, the base's parameters and those of `effects`; `fixed` are the values of all others.
    """

    kind: Kind
    records: Sequence[Record]
    effects: tuple[str, ...]
    criterion: int
    axes: Sequence[FreeParameter]
    fixed: Theta = field(default_factory=Theta)

    @classmethod
    def of(cls, kind: Kind, records: Sequence[Record], effects: Sequence[str], criterion: int | None = None) -> Fitter:
        """The fitter of the base with `effects`; without a criterion to the free run."""
        wanted = kind.free_run if criterion is None else criterion
        return cls(kind, records, tuple(effects), wanted, axes(kind, effects))

    def near(
        self, start: Theta, widths: Sequence[float] = (*SET.narrow, SET.fine[-1]), rounds: int = SET.most_rounds
    ) -> Fit:
        """A descent from `start`, with derivatives as secants that look across jags: first wide, then narrower."""
        fixed = start.only({*self.effects, *self.kind.in_base})
        own = replace(self, fixed=fixed, axes=[axis.on_side_of(start) for axis in self.axes])
        x = own.at(start)
        if not len(x):
            (r,) = own.residuals([x])
            return Fit(fixed, float(r @ r), len(r), np.zeros((len(r), 0)), r)
        end = own._solver.minimum(x, widths, rounds)
        return Fit(own.theta(end.x), end.cost, len(end.residual), end.jacobian, end.residual)

    def far(self, starts: Sequence[Theta], enough: float = SET.near, seeds: int = SET.seeds) -> Fit:
        """The best fit from anywhere: from close by each of `starts`; where that leaves more than `enough` for each
        residual of a time series, on growing prefixes from many points around the starts and around the nominal base,
        at most `seeds` times with other points, until none does better.
        """
        starts = [start.only({*self.effects, *self.kind.in_base}) for start in starts]
        for criterion in () if self.kind.beginnings_s else range(self.criterion):  # smoother ones lead the way
            opened = Fitter.of(self.kind, self.records, self.effects, criterion)
            starts = [start | opened.near(start).theta for start in starts]
        fits = [self.near(start) for start in starts]
        if len(fits) == 1 and not seeds:
            return fits[0]
        left = [judged_cost(self.kind, self.records, fit.theta) for fit in fits]
        for seed in range(1, 1 + (seeds if self.kind.beginnings_s else 0)):
            least = min(left)
            if least <= enough:
                break
            growth = Growth(self.plain(), begins(self.kind, starts), seed)
            fits.append(self.near(growth.over(self.records)))
            left.append(judged_cost(self.kind, self.records, fits[-1].theta))
            if seed > 1 and abs(left[-1] - least) <= SET.refines * least:
                break
        return fits[int(np.argmin(left))]

    def exactly(self, start: Theta) -> Fit:
        """From a fit, `near` at the final criterion; beyond chance also from points that the fit allows."""
        final = Fitter.of(self.kind, self.records, self.effects, self.kind.final)
        best = final.near(start, SET.fine, SET.rounds)
        more = self.axes and self.kind.beginnings_s and not best.by_chance and best.jacobian.any()
        for seed in range(SET.ways_down if more else 0):
            some = final.lowest(self.lowest(final._likely(best, seed), SET.down_ranked), SET.down_from)
            again = min(each(lambda point: final.near(point, SET.fine, SET.rounds), some), key=attrgetter("cost"))
            gained = again.cost < (1 - SET.refines) * best.cost
            best = min(best, again, key=attrgetter("cost"))
            if not gained or best.by_chance:
                break
        return best

    def allowed(self, fit: Fit) -> list[Theta]:
        """The `fit`, and points around it that cost at most a tenth more."""
        points = self._likely(fit, 0, within=True) if fit.jacobian.any() else []
        most = (1 + SET.beside) * fit.cost
        return [fit.theta, *(point for point, cost in zip(points, self.costs(points), strict=True) if cost <= most)]

    def _likely(self, fit: Fit, seed: int, within: bool = False) -> list[Theta]:
        """Points around a `fit` in the directions that it knows least: to first order each costs a tenth more, `within`
        at most that.
        """
        squares, vectors = np.linalg.eigh(fit.jacobian.T @ fit.jacobian)
        reach = np.sqrt(SET.beside * fit.cost / np.maximum(squares, SET.tiny * squares[-1]))
        rng = np.random.default_rng(seed)
        draws = rng.standard_normal((SET.near_by, len(squares)))
        own, x = replace(self, fixed=fit.theta), self.at(fit.theta)
        steps = (draws / np.linalg.norm(draws, axis=1, keepdims=True) * reach) @ vectors.T
        if within:
            steps *= rng.random((SET.near_by, 1))
        return [own.theta(self._solver.clip(x + step)) for step in steps]

    def plain(self) -> Fitter:
        """The same over the base's parameters and those that say how large each effect is and of what kind: size,
        place, phase and what its grid spans; of a refinement, which is but a shape, all. Finer shapes of many numbers
        follow anything on a short record. A table is never short.
        """
        named = self.kind.catalogue
        if not self.kind.beginnings_s:
            return self

        def first(p: Parameter) -> bool:
            effect = named[p.effect]
            named_by = {effect.amplitude().name, effect.of_role("place"), effect.of_role("phase"), *effect.grid}
            return effect in REFINEMENTS or p.name in named_by

        return replace(self, axes=[a for a in self.axes if not a.parameter.effect or first(a.parameter)])

    def lowest(self, thetas: Sequence[Theta], count: int) -> list[Theta]:
        """The `count` of `thetas` with the lowest cost, lowest first."""
        return [thetas[k] for k in np.argsort(self.costs(thetas), kind="stable")[:count]]

    def costs(self, thetas: Sequence[Theta]) -> list[float]:
        """Sum of squares of the records' residuals at each of `thetas`."""

        def together(first: int) -> list[float]:  # at about the price of one
            some = thetas[first : first + self.kind.lanes]
            rows = evaluate_all(self.kind, self.records, some, self.criterion)
            return [float(cost) for cost in np.einsum("ij,ij->i", rows, rows)]

        return [cost for costs in each(together, range(0, len(thetas), self.kind.lanes)) for cost in costs]

    def theta(self, x: Array) -> Theta:
        """The parameters by name at the point `x` (n,)."""
        return self.fixed | {a.name: float(v) for a, v in zip(self.axes, x, strict=True)}

    def at(self, theta: Theta) -> Array:
        """The point (n,) of `theta`, within the bounds; declared values where it has none."""
        return self._solver.clip(np.array([theta.get(a.name, a.parameter.value) for a in self.axes]))

    def residuals(self, points: Sequence[Array]) -> Array:
        """Residuals (P, m) at each point: of the records, and of the parameters that have a prior."""
        rows = evaluate_all(self.kind, self.records, [self.theta(x) for x in points], self.criterion)
        priors = [(i, a.parameter) for i, a in enumerate(self.axes) if np.isfinite(a.parameter.spread)]
        if not priors:
            return rows
        own = [[(x[i] - p.value) / p.spread for i, p in priors] for x in points]
        return np.concatenate([rows, own], axis=1)

    def clip(self, x: Array) -> Array:
        """The point `x` (n,) within the bounds."""
        return self._solver.clip(x)

    @cached_property
    def _solver(self) -> GaussNewton:
        ends = np.array([(a.parameter.lower, a.parameter.upper, a.scale) for a in self.axes]).reshape(-1, 3)
        return GaussNewton(self.residuals, ends[:, 0], ends[:, 1], ends[:, 2])


@dataclass
class Growth:
    """One model fitted on growing prefixes, from the first slip events to whole records. Every length is started from
    the fits of the length before, from the `starts` again, and from effects redrawn on the bases found so far, because
    a short prefix cannot show every effect. The best fit so far is kept. Of the newest effect not even the size is
    known, so that it begins as declared, too. `fits` are those of the last length, the best first, without their rows.
    """

    model: Fitter
    starts: Sequence[Theta]
    seed: int = 0
    fits: list[Fit] = field(default_factory=list)

    def on(self, number: int, records: Sequence[Record]) -> list[Fit]:
        """The fits of the next length, `records` being the prefixes number `number`."""
        fitter, kept = replace(self.model, records=records), SET.kept[number]
        found = [fit.theta for fit in self.fits]
        points = [*found, *self.starts, *self._drawn(found)]
        best = fitter.lowest(points, kept)
        if found and kept > 1 and found[0] not in best:
            best[-1] = found[0]
        late = number >= SET.ranked_from
        widths, rounds = (SET.narrow, SET.rounds) if late else (SET.narrow[-1:], SET.first_rounds)
        self.fits = sorted(each(lambda point: fitter.near(point, widths, rounds).bare(), best), key=attrgetter("cost"))
        return self.fits

    def over(self, records: Sequence[Record]) -> Theta:
        """Where the best fit on the whole `records` ends."""
        for number, parts in lengths(self.model.kind, records):
            self.on(number, parts)
        return self.fits[0].theta

    def _drawn(self, found: Sequence[Theta]) -> list[Theta]:
        """Points around the nominal base and the starts' effects, with every size of the newest one; once bases are
        `found`, each with effects drawn around their declared values: a drift does not show at first.
        """
        kind, effects, starts, moved = self.model.kind, self.model.effects, [*self.starts], self.model.axes
        newest = next((name for name in reversed(effects) if kind.catalogue[name] not in REFINEMENTS), "")
        if found:
            moved = [axis for axis in moved if axis.parameter.effect in effects]
            bases = [theta.only(kind.in_base) for theta in found[: SET.bases]]
            return scattered(kind, moved, bases, SET.points // 2, self.seed + 1, newest)
        if newest:
            starts.append(starts[-1].with_(newest, kind.catalogue[newest].start()))
        return scattered(kind, moved, starts, SET.points, self.seed, newest)


def begins(kind: Kind, starts: Sequence[Theta]) -> list[Theta]:
    """`starts`, and the first at the nominal base: one fitted without an effect may compensate for it."""
    return [*starts, starts[0] | Theta.declared(p for p in kind.base if p.fit)]
