"""Fits by several methods: descent from the start, growing prefixes; the better one counts."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from models.effects import REFINEMENTS
from models.identification.fitting.fit import Fit, FreeParameter, Problem, costs_of
from models.identification.kind import Kind
from models.identification.search.fitted_model import FittedModel, judged_cost
from models.identification.search.growing_horizon import FROM_CLOSE, QUICK, THOROUGH, GrowingHorizon, base_known
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta

_CLOSER = (SET.narrow[0], *SET.fine)


def refit(
    kind: Kind,
    records: Sequence[Record],
    effects: Sequence[str],
    start: Theta,
    enough: float = SET.near,
    quick: float = math.inf,
) -> Theta:
    """The best fit to `records` of several methods, as judged. First a descent from `start`; where this costs more than
    `quick` for a time series, quick growing prefixes; where these cost more than `enough` (about the noise), thorough
    ones from `start` and from the nominal base, there also with the newest effect as it is declared.
    """
    if not kind.beginnings_s:
        for criterion in range(kind.criteria):
            start = Problem.of(kind, records, effects, criterion).narrowing(start).theta
        return start
    fits = [stepped(kind, records, effects, start)]
    costs = [judged_cost(kind, records, fits[0])]
    if costs[0] > quick:
        fits.append(GrowingHorizon(kind, effects, begins(kind, start), QUICK).over(records).theta)
        costs.append(judged_cost(kind, records, fits[-1]))
    if min(costs) > enough:
        fits.append(_lengthened(kind, records, effects, start))
        costs.append(judged_cost(kind, records, fits[-1]))
    return fits[int(np.argmin(costs))]


def step_on(kind: Kind, records: Sequence[Record], effects: Sequence[str], start: Theta) -> Fit:
    """A descent on the free run from `start`."""
    return Problem.of(kind, records, effects).narrowing(start, _CLOSER if kind.beginnings_s else SET.fine, 10)


def stepped(kind: Kind, records: Sequence[Record], effects: Sequence[str], start: Theta) -> Theta:
    """Where `step_on` ends."""
    return step_on(kind, records, effects, start).theta


def _lengthened(kind: Kind, records: Sequence[Record], effects: Sequence[str], start: Theta, seed: int = 0) -> Theta:
    """A fit on growing prefixes from `start`, at the nominal base, there also with the newest effect as declared."""
    starts = begins(kind, start)
    newest = next((name for name in reversed(effects) if kind.catalogue[name] not in REFINEMENTS), "")
    if newest:
        starts.append(starts[-1].with_(newest, kind.catalogue[newest].start()))
    effort = FROM_CLOSE if base_known(kind) else THOROUGH
    return GrowingHorizon(kind, effects, starts, effort, newest, seed).over(records).theta


def begins(kind: Kind, theta: Theta) -> list[Theta]:
    """`theta`, and the same at the nominal base: one fitted without an effect may compensate for it."""
    return [theta, theta | Theta.declared(p for p in kind.base if p.fit)]


def whole(
    kind: Kind,
    records: Sequence[Record],
    effects: Sequence[str],
    start: Theta,
    enough: float = SET.near,
    *,
    to_the_end: bool = True,
) -> Fit:
    """The best fit to `records` (`refit`), `finished` where it goes `to_the_end`. Where that costs more than `enough`
    for a time series without narrow priors, growing prefixes are started once more from new starts: a base that is off
    by a slip event would look like one that lacks an effect.
    """
    problem = Problem.of(kind, records, effects)

    def ended(begun: Theta) -> Fit:
        fit = problem.narrowing(begun, SET.fine)
        return finished(kind, records, effects, fit) if to_the_end else fit

    fit = ended(refit(kind, records, effects, start, enough))
    if kind.beginnings_s and fit.chi2 > enough and not base_known(kind):
        again = _lengthened(kind, records, effects, fit.theta, SET.other_starts)
        fit = min(fit, ended(again), key=_cost)
    return fit


def finished(kind: Kind, records: Sequence[Record], effects: Sequence[str], fit: Fit) -> Fit:
    """`fit` at the kind's final criterion, descended again as long as that gains. Secants are wide only where the cost
    is above the noise. A fit that may lack only a slip event is also started from the best points near it. A kind with
    one criterion has no other.
    """
    if kind.criteria == 1:
        return fit
    widths = SET.fine if fit.chi2 < SET.near else (*SET.wide, SET.fine[-1])
    problem = Problem.of(kind, records, effects, kind.final)
    best = problem.narrowing(fit.theta, widths)
    for _ in range(SET.ways_down):
        again = problem.narrowing(best.theta, _CLOSER)
        helped = again.cost < (1 - SET.refines) * best.cost
        best = min(best, again, key=_cost)
        if not helped:
            break
    if best.chi2 > SET.events:
        others = [problem.narrowing(point, SET.fine) for point in _close_by(problem, best.theta)]
        best = min([best, *others], key=_cost)
    return best


def _cost(fit: Fit) -> float:
    return fit.cost


def _close_by(problem: Problem, theta: Theta) -> list[Theta]:
    """The best of many points around `theta`, within a few percent of each fitted value."""
    x, solver = problem.start(theta), problem.solver
    shares = scipy.stats.qmc.Sobol(len(x), seed=2).random(SET.near_by) if len(x) else np.zeros((0, 0))
    points = [problem.theta(solver.clip(x + SET.beside * solver.scale * (2 * share - 1))) for share in shares]
    costs = costs_of(problem.kind, problem.records, points, problem.criterion)
    return [points[k] for k in np.argsort(costs, kind="stable")[: SET.down_from]]


def as_called(model: FittedModel, name: str) -> FittedModel:
    """`model` with the effect `name` within the range that its name stands for. Some effects contain another as a
    limit: a wave of very long wavelength is a force in time. A parameter with such a limit (`least`) stays above it; of
    the fits on either side of zero the better one is taken.
    """
    least = [p for p in model.kind.catalogue[name].parameters() if p.least]
    if all(abs(theta.get((name, p.name), p.value)) >= p.least for p in least for theta in model.thetas):
        return model

    def on_a_side(kind: Kind, part: Sequence[Record], effects: Sequence[str], theta: Theta) -> Theta:
        problem = Problem.of(kind, part, effects)
        sides = [replace(problem, axes=[_side(axis, name, sign) for axis in problem.axes]) for sign in (1.0, -1.0)]
        return min((side.narrowing(theta, _CLOSER, 10) for side in sides), key=_cost).theta

    return model.refitted(on_a_side, model.thetas)


def _side(axis: FreeParameter, effect: str, sign: float) -> FreeParameter:
    """The axis with its parameter beyond `least` on one side of zero."""
    p = axis.parameter
    if not p.least or p.effect != effect:
        return axis
    lower, upper = (p.least, p.upper) if sign > 0 else (p.lower, -p.least)
    begin = math.copysign(max(abs(p.value), p.least), sign)
    return replace(axis, parameter=replace(p, lower=lower, upper=upper, value=begin))
