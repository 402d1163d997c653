"""Ways to a fit: stepped on from where it is, on ever longer beginnings; the better of them as judged."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import qmc

from models.effects import REFINEMENTS
from models.identification.fitting.fit import Fit, Problem, costs_of, narrowing
from models.identification.kind import Kind
from models.identification.search.growing_horizon import FROM_CLOSE, QUICK, THOROUGH, base_known, grow_horizon
from models.identification.search.validation import free_run, judged_cost
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


def refit(
    kind: Kind, records: Sequence[Record], effects: Sequence[str], start: Theta, enough: float = SET.near
) -> Theta:
    """The best of several ways to a fit on `records`, as judged: stepped on from where it is; and, where this leaves
    more than `enough` (about the noise) of a time series, on ever longer beginnings from where it is and from the
    nominal base, there also with the newest effect as it is declared.
    """
    if not kind.beginnings_s:
        for criterion in range(kind.criteria):
            start = narrowing(Problem.of(kind, records, effects, criterion), start).theta
        return start
    fits = [step_on(kind, records, effects, start).theta]
    costs = [judged_cost(kind, records, fits[0])]
    if costs[0] > enough:
        fits.append(_lengthened(kind, records, effects, start))
        costs.append(judged_cost(kind, records, fits[1]))
    return fits[int(np.argmin(costs))]


def mend(kind: Kind, records: Sequence[Record], effects: Sequence[str], start: Theta) -> Theta:
    """The best fit with one more free curve: from close by; where that leaves more than the noise to a hundredth of a
    time series, on ever longer beginnings too; and from more places where these leave `SET.near`.
    """
    if not kind.beginnings_s:
        return refit(kind, records, effects, start)
    fits = [step_on(kind, records, effects, start).theta]
    costs = [judged_cost(kind, records, fits[0])]
    if costs[0] > 1 + SET.shaped:
        fits.append(grow_horizon(kind, records, effects, begins(kind, start), QUICK).theta)
        costs.append(judged_cost(kind, records, fits[-1]))
    if min(costs) > SET.near:
        fits.append(_lengthened(kind, records, effects, start))
        costs.append(judged_cost(kind, records, fits[-1]))
    return fits[int(np.argmin(costs))]


def step_on(kind: Kind, records: Sequence[Record], effects: Sequence[str], start: Theta) -> Fit:
    """A fit to the free run from where the start is."""
    return narrowing(
        Problem.of(kind, records, effects, free_run(kind)),
        start,
        (SET.narrow[0], *SET.fine) if kind.beginnings_s else SET.fine,
        10,
    )


def _lengthened(kind: Kind, records: Sequence[Record], effects: Sequence[str], start: Theta, seed: int = 0) -> Theta:
    """A fit on ever longer beginnings from `start`, at the nominal base too, and there also with the newest effect as
    it is declared.
    """
    starts = begins(kind, start)
    newest = next((name for name in reversed(effects) if kind.catalogue[name] not in REFINEMENTS), "")
    if newest:
        starts.append(starts[-1].with_(newest, kind.catalogue[newest].start()))
    effort = FROM_CLOSE if base_known(kind) else THOROUGH
    return grow_horizon(kind, records, effects, starts, effort, newest, seed).theta


def begins(kind: Kind, theta: Theta) -> list[Theta]:
    """`theta`, and the same at the nominal base: one fitted without an effect may be bent to make up for it."""
    return [theta, theta | Theta.declared(p for p in kind.base if p.fit)]


def calibrated(kind: Kind, records: Sequence[Record]) -> Fit:
    """The base alone fitted to `records` from its nominal values. Where that leaves more than the noise of a series, it
    is looked for from other places on ever longer beginnings: a base that is stuck a slip event beside the right one
    would pass for one that lacks an effect. One that a prior holds is not.
    """
    problem = Problem.of(kind, records, [], free_run(kind))
    fit = narrowing(problem, refit(kind, records, [], kind.nominal()), SET.fine)
    if kind.beginnings_s and fit.chi2 > SET.near and not base_known(kind):
        fit = min(fit, _from_other_places(problem, [], fit.theta), key=_cost)
    return fit


def whole(kind: Kind, records: Sequence[Record], effects: Sequence[str], start: Theta, enough: float = SET.near) -> Fit:
    """The best of several ways to a fit on `records` (`refit`), finished. Where that leaves more than `enough`
    of a time series whose base no prior holds, the ever longer beginnings are gone through from other places once more.
    """
    problem = Problem.of(kind, records, effects, free_run(kind))
    begun = refit(kind, records, effects, start, enough)
    fit = finished(kind, records, effects, narrowing(problem, begun, SET.fine))
    if kind.beginnings_s and fit.chi2 > enough and not base_known(kind):
        again = _from_other_places(problem, effects, fit.theta)
        fit = min(fit, finished(kind, records, effects, again), key=_cost)
    return fit


def _from_other_places(problem: Problem, effects: Sequence[str], theta: Theta) -> Fit:
    """A fit by ever longer beginnings from places that no search before has drawn."""
    begun = _lengthened(problem.kind, problem.records, effects, theta, SET.other_places)
    return narrowing(problem, begun, SET.fine)


def finished(kind: Kind, records: Sequence[Record], effects: Sequence[str], fit: Fit) -> Fit:
    """`fit` at the kind's final criterion, descended anew as long as that helps: where one way down ends another
    begins. Wide secants only where more than the noise is left. One that may lack but a slip event is looked for from
    the best places close by too. A kind with one criterion has no other.
    """
    if kind.criteria == 1:
        return fit
    widths = SET.fine if fit.chi2 < SET.near else (*SET.wide, SET.fine[-1])
    problem = Problem.of(kind, records, effects, kind.final)
    best = narrowing(problem, fit.theta, widths)
    for _ in range(SET.ways_down):
        again = narrowing(problem, best.theta, (SET.narrow[0], *SET.fine))
        helped = again.cost < (1 - SET.refines) * best.cost
        best = min(best, again, key=_cost)
        if not helped:
            break
    if best.chi2 > SET.events:
        best = min(
            [best, *(narrowing(problem, place, SET.fine) for place in _close_by(problem, best.theta))], key=_cost
        )
    return best


def _cost(fit: Fit) -> float:
    return fit.cost


def _close_by(problem: Problem, theta: Theta) -> list[Theta]:
    """The best of many places around `theta`, within a few percent of each fitted value."""
    x = problem.start(theta)
    shares = qmc.Sobol(len(x), seed=2).random(SET.near_by) if len(x) else np.zeros((0, 0))
    points = [problem.theta(problem.valley.clip(x + SET.beside * problem.scale * (2 * share - 1))) for share in shares]
    costs = costs_of(problem.kind, problem.records, points, problem.criterion)
    return [points[k] for k in np.argsort(costs, kind="stable")[: SET.down_from]]
