"""Comparison of candidates: joint fits by successive elimination, the finalists judged on validation records."""

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from operator import itemgetter

import numpy as np

from models.effects import CATALOGUE, REFINEMENTS
from models.identification.fitting.fit import Fit, Problem, costs_of
from models.identification.kind import Array, Kind
from models.identification.search.fitted_model import Fits, FittedModel, ahead, judged, judged_cost
from models.identification.search.growing_horizon import FROM_CLOSE, QUICK, GrowingHorizon, base_known, eliminate
from models.identification.search.refit import as_called, begins, refit, stepped
from models.identification.search.screening import Screened
from models.identification.settings import SET
from models.parameter import Name
from models.records.record import Record
from models.theta import Theta

Moved = Callable[[str, float], None]


_MULTIPLES = tuple(2.0**k for k in range(6))


@dataclass(frozen=True)
class Trial:
    """A model with one more `effect`: `thetas` are the fits, one a split; `blocks` the validation cost by block, with
    the refinements of the effect where they help; `before` the same without the effect; `refinements` further fits,
    with refinements, by model.
    """

    effect: str
    thetas: tuple[Theta, ...]
    before: Array
    blocks: Array
    refinements: Mapping[tuple[str, ...], tuple[Theta, ...]] = field(default_factory=dict)

    @classmethod
    def of(cls, model: FittedModel, effect: str, fitted: FittedModel) -> "Trial":
        """What `fitted` with the `effect` adds to `model`."""
        return cls(effect, fitted.thetas, model.blocks, fitted.blocks)

    @property
    def gain(self) -> float:
        """What it adds on validation records: `ln(cost without/cost with)`."""
        return float(np.log(self.before.sum() / max(self.blocks.sum(), 1e-300)))

    @property
    def drop(self) -> float:
        """The same as a difference, for each residual."""
        return float(self.before.mean() - self.blocks.mean())


def compare_candidates(
    model: FittedModel, screened: Sequence[Screened], moved: Moved = lambda name, share: None
) -> list[Trial]:
    """Joint fits of `model` with one more effect: short ones of every candidate, full ones of the best three and of the
    declared confounders of the best; best gain first. Empty where no candidate passed the screening. `moved` is called
    with each candidate and the share of the work that is done.
    """
    if not screened:
        return []
    grows = bool(model.kind.beginnings_s)
    fitted = (_grown if grows else _survivors)(model, screened, moved)
    ranking = sorted(fitted, key=lambda name: fitted[name].cost)
    alike = model.kind.catalogue[ranking[0]].confounders
    finalists = [
        name
        for k, name in enumerate(ranking)
        if fitted[name].cost <= SET.behind * fitted[ranking[0]].cost and (k < SET.final or name in alike)
    ]
    trials = []
    for k, name in enumerate(finalists):
        moved(name, 0.8 + 0.2 * k / len(finalists))
        trials.append(_judge(model, name, fitted[name].theta))
    refinable = min((trial.blocks.mean() for trial in trials), default=0.0) > SET.near
    helped = [_with_refinements(model, trial, fitted[trial.effect].theta if refinable else None) for trial in trials]
    trials = [_as_called(model, trial) for trial in (from_the_best(model, trials, helped) if grows else helped)]
    return sorted(trials, key=lambda trial: -trial.gain)


def _as_called(model: FittedModel, trial: Trial) -> Trial:
    """The trial with its effect within the range that its name stands for."""
    plain = model.fitted(trial.thetas, [*model.effects, trial.effect])
    called = as_called(plain, trial.effect)
    return trial if called is plain else Trial.of(model, trial.effect, called)


def _refinements(kind: Kind, name: str) -> list[str]:
    """Refinements that a candidate may need before it can be compared: those that are catalogue effects themselves, and
    those that split a changed resistance between nose and slip limit.
    """
    known = {effect.id for effect in kind.effects}
    named = kind.catalogue
    return [
        c
        for c in named[name].refined_by
        if c in known or (named[c].answers("shared") and kind.name in named[c].kinds and c not in kind.in_base)
    ]


def _with_refinements(so_far: FittedModel, trial: Trial, sought: Theta | None) -> Trial:
    """`trial` with the cost of its refinements where that is lower, fitted also from the point that its elimination
    round `sought`: of two imperfect candidates that one leads which its refinements complete. Nothing `sought`: no
    refinements. A trial without refinements is fitted again from more starts.
    """
    kind = so_far.kind
    refinements = [c for c in _refinements(kind, trial.effect) if c not in so_far.effects] if sought else []
    if not refinements and not kind.beginnings_s:
        return trial
    more = [sought] if refinements and sought else []
    finer = [*so_far.effects, trial.effect, *refinements]
    fitted = so_far.refitted(best_from, ([theta, *more] for theta in trial.thetas), finer)
    again = Trial.of(so_far, trial.effect, fitted)
    if not refinements:
        return again
    trial = replace(trial, refinements={fitted.effects: fitted.thetas})
    return replace(trial, blocks=again.blocks) if again.gain > trial.gain else trial


def best_from(kind: Kind, part: Sequence[Record], effects: Sequence[str], starts: Iterable[Theta]) -> Theta:
    """The best of the fits from each of `starts`, as judged."""
    ends = [refit(kind, part, effects, start) for start in starts]
    return min(ends, key=lambda end: judged_cost(kind, part, end))


def from_the_best(model: FittedModel, alone: Sequence[Trial], helped: Sequence[Trial]) -> list[Trial]:
    """The `helped` trials, with the confounders of the best one and its catalogue refinements also fitted from its
    base: none may win by a luckier search. Where such a refinement does about as well without the best one, the best
    one is judged `alone`.
    """
    kind, effects, named = model.kind, model.effects, model.kind.catalogue
    rows = {trial.effect: trial for trial in helped}
    if not rows:
        return []
    best = max(helped, key=lambda trial: trial.gain)
    both = next(iter(best.refinements.values()), None)
    beside = [c for c in _refinements(kind, best.effect) if named[c] not in REFINEMENTS] if both else []
    alike = [name for name in rows if named[best.effect].looks_like(named[name])]
    for name in dict.fromkeys((*beside, *alike)):
        owns = both if both and name in beside else rows[name].thetas
        bases = (base.only({*effects, *kind.in_base}) for base in both or best.thetas)
        starts = (base.with_(name, own.effects[name]) for base, own in zip(bases, owns, strict=True))
        again = Trial.of(model, name, model.refitted(stepped, starts, [*effects, name]))
        if name not in rows or again.gain > rows[name].gain:
            rows[name] = again
        if name in beside and (
            rows[name].gain > best.gain - SET.shaped or ahead(best.blocks, rows[name].blocks) < SET.apart
        ):
            rows[best.effect] = next(trial for trial in alone if trial.effect == best.effect)
    return list(rows.values())


def _grown(model: FittedModel, screened: Sequence[Screened], moved: Moved) -> dict[str, Fit]:
    """Fits of `model` with each candidate on growing prefixes, from its screening starts on either base, and also from
    starts where the slip limit does not follow the resistance; without those that were eliminated.
    """
    kind = model.kind
    effort = FROM_CLOSE if base_known(kind) else QUICK
    horizons = {}
    for row in screened:
        beside = shared_by(kind, row.effect)
        starts = [
            point
            for base in begins(kind, model.thetas[0])
            for start in row.starts
            for point in with_each(base.with_(row.effect, start), beside)
        ]
        horizons[row.effect] = GrowingHorizon(kind, [*model.effects, row.effect, *beside], starts, effort, row.effect)
    return eliminate(model.part, horizons, SET.final, SET.behind, lambda name, share: moved(name, 0.8 * share))


def _survivors(model: FittedModel, screened: Sequence[Screened], moved: Moved) -> dict[str, Fit]:
    """Fits of `model` with each candidate, good enough for a ranking: one round of descent from its best opening at the
    kind's first criterion, a few more rounds of the lowest, full fits of the first of these and of their confounders.
    """
    kind, bases = model.kind, begins(model.kind, model.thetas[0])

    def problem(name: str, criterion: int) -> Problem:
        return Problem.of(kind, model.part, [*model.effects, name], criterion)

    fits = {}
    for k, row in enumerate(screened):
        moved(row.effect, 0.3 * k / len(screened))
        start = opening(kind, model.part, bases, row.effect, row.starts)
        fits[row.effect] = problem(row.effect, 0).descend(start, SET.narrow[0], 1)
    lowest = sorted(fits, key=lambda name: fits[name].cost)[: SET.entered]
    for k, name in enumerate(lowest):
        moved(name, 0.3 + 0.1 * k / len(lowest))
        fits[name] = problem(name, 0).descend(fits[name].theta, SET.narrow[0], SET.entered_rounds)
    entered = _with_confounders(kind, sorted(fits, key=lambda name: fits[name].cost))
    survivors = {}
    for k, name in enumerate(entered):
        moved(name, 0.4 + 0.4 * k / len(entered))
        survivors[name] = problem(name, kind.free_run).narrowing(fits[name].theta, SET.narrow, 8)
    return survivors


def shared_by(kind: Kind, name: str) -> list[str]:
    """The refinements that a candidate may need and that no search names by itself."""
    return [c for c in _refinements(kind, name) if CATALOGUE.get(c) in REFINEMENTS]


def with_each(start: Theta, refinements: Sequence[str]) -> list[Theta]:
    """`start`, and with each shape on the refinements' grids."""
    grid: dict[Name, tuple[float, ...]]
    grid = {(c, name): values for c in refinements for name, values in CATALOGUE[c].grid.items()}
    rows = itertools.product(*grid.values())
    return [start, *(start | dict(zip(grid, row, strict=True)) for row in rows if row)]


def opening(
    kind: Kind, part: Sequence[Record], bases: Sequence[Theta], name: str, starts: Iterable[Mapping[str, float]]
) -> Theta:
    """The point with the best amplitude of `name` in the best shape of `starts` at the best of `bases`."""
    effect = next(e for e in kind.effects if e.id == name)
    amplitude = effect.amplitude()

    def best(start: Mapping[str, float]) -> tuple[float, Theta]:
        wanted = [start[amplitude.name], *(sign * effect.probe * k for k in _MULTIPLES for sign in (1.0, -1.0))]
        values = sorted({v for v in wanted if amplitude.lower <= v <= amplitude.upper and v != 0.0})
        points = [base.with_(name, {**start, amplitude.name: value}) for base in bases for value in values]
        costs = costs_of(kind, part, points, kind.free_run)
        return min(zip(costs, points, strict=True), key=itemgetter(0))

    return min(map(best, starts), key=itemgetter(0))[1]


def _with_confounders(kind: Kind, entered: Sequence[str]) -> list[str]:
    """The best entries and the confounders of the first few, which only a full fit separates."""
    declared = {effect.id: effect for effect in kind.effects}
    wanted = list(entered[: SET.pool])
    for name in entered[: SET.alike]:
        wanted += [other for other in declared[name].confounders if other in entered and other not in wanted]
    return wanted


def _judge(model: FittedModel, name: str, start: Theta) -> Trial:
    """`model` with the effect `name` fitted on every split from `start`, and judged."""
    kind, own = model.kind, start.effects[name]
    starts = [
        min((theta.with_(name, own), start), key=lambda point: float(judged(kind, part, point).sum())) if i else start
        for i, (part, theta) in enumerate(model.parts)
    ]
    return Trial.of(model, name, model.refitted(partial(refit, enough=np.inf), starts, [*model.effects, name]))


def better_without(model: FittedModel, further: str, others: Fits) -> FittedModel:
    """The better of `model` and of the same refitted from the base of fits with one `further` effect, `others`."""
    again = model.refitted(stepped, (theta.without(further) for theta in others))
    return min(model, again, key=lambda choice: choice.training_cost)


def fair(model: FittedModel, trials: Sequence[Trial]) -> tuple[list[Trial], FittedModel]:
    """The trials against the best fit *without* a further effect, also started from their bases; and that fit."""
    best = model
    for trial in trials[:2]:
        best = better_without(best, trial.effect, trial.thetas)
    return sorted((replace(t, before=best.blocks) for t in trials), key=lambda trial: -trial.gain), best
