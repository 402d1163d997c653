"""Comparison of candidates: joint fits by successive elimination, the finalists judged on validation records."""

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from operator import attrgetter, itemgetter

import numpy as np

from models.effects import CATALOGUE, REFINEMENTS
from models.identification.fitting.fit import Fit
from models.identification.fitting.fitter import Fitter, Growth, begins
from models.identification.fitting.horizon import lengths
from models.identification.kind import Array, Kind
from models.identification.search.fitted_model import Fits, FittedModel
from models.identification.search.screening import Screened
from models.identification.settings import SET
from models.parameter import Name
from models.records.record import Record
from models.theta import Theta
from models.workers import each

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
    series = bool(model.kind.beginnings_s)
    fitted = (_grown if series else _survivors)(model, screened, moved)
    ranking = sorted(fitted, key=lambda name: fitted[name].cost)
    alike = model.kind.catalogue[ranking[0]].confounders
    finalists = [
        name
        for k, name in enumerate(ranking)
        if fitted[name].cost <= SET.behind * fitted[ranking[0]].cost and (k < SET.final or name in alike)
    ]
    moved(finalists[0], 0.8)
    trials = each(lambda name: _near(model, name, fitted[name].theta), finalists)
    if series and min(trial.blocks.mean() for trial in trials) > SET.near:
        moved(finalists[0], 0.9)
        trials = each(lambda trial: _completed(model, trial, fitted[trial.effect].theta), trials)
    leader = max(trials, key=attrgetter("gain"))
    trials = each(lambda trial: _within_name(model, _from_base_of(model, leader, trial)), trials)
    return sorted(trials, key=lambda trial: -trial.gain)


def _near(model: FittedModel, name: str, start: Theta) -> Trial:
    """`model` with the effect `name` fitted on every split from close by `start`, and judged."""
    own = start.effects[name]
    starts = [start if not i else theta.with_(name, own) for i, theta in enumerate(model.thetas)]
    return Trial.of(model, name, model.near(starts, [*model.effects, name]))


def _within_name(model: FittedModel, trial: Trial) -> Trial:
    """The trial with its effect within the range that its name stands for."""
    plain = model.fitted(trial.thetas, [*model.effects, trial.effect])
    called = plain.within_name(trial.effect)
    return trial if called is plain else Trial.of(model, trial.effect, called)


def _completed(so_far: FittedModel, trial: Trial, sought: Theta) -> Trial:
    """`trial` fitted quickly from anywhere, also from the point that its elimination `sought`, with the cost of its
    refinements where that is lower: of two imperfect candidates that one leads which its refinements complete.
    """
    effects = [*so_far.effects, trial.effect]
    starts = [[theta, sought.only(so_far.kind.in_base | set(effects))] for theta in trial.thetas]
    plain = so_far.far(starts, effects, seeds=1)
    again = Trial.of(so_far, trial.effect, plain)
    best = again if again.gain > trial.gain else trial
    shared = shared_by(so_far.kind, trial.effect)
    if not shared or best.blocks.mean() <= SET.near:
        return best
    finer = so_far.far(([theta, sought] for theta in best.thetas), [*effects, *shared], seeds=1)
    better = Trial.of(so_far, trial.effect, finer)
    blocks = better.blocks if better.gain > best.gain else best.blocks
    return replace(best, blocks=blocks, refinements={finer.effects: finer.thetas})


def _from_base_of(model: FittedModel, leader: Trial, trial: Trial) -> Trial:
    """The better of `trial` and of the same from the base of the `leader`: none may lead by a luckier search."""
    if trial is leader:
        return trial
    pairs = zip(leader.thetas, trial.thetas, strict=True)
    starts = (base.without(leader.effect).with_(trial.effect, own.effects[trial.effect]) for base, own in pairs)
    again = Trial.of(model, trial.effect, model.near(starts, [*model.effects, trial.effect]))
    return replace(again, refinements=trial.refinements) if again.gain > trial.gain else trial


def _grown(model: FittedModel, screened: Sequence[Screened], moved: Moved) -> dict[str, Fit]:
    """Fits of `model` with each candidate on growing prefixes, from its screening starts on either base, and also from
    starts where the slip limit does not follow the resistance; without those that were eliminated.
    """
    kind = model.kind
    growths = {}
    for row in screened:
        beside = shared_by(kind, row.effect)
        starts = [
            point
            for base in begins(kind, model.thetas[:1])
            for start in row.starts
            for point in with_each(base.with_(row.effect, start), beside)
        ]
        fitter = Fitter.of(kind, model.part, [*model.effects, row.effect, *beside]).plain()
        growths[row.effect] = Growth(fitter, starts)
    return eliminate(model.part, growths, SET.final, SET.behind, lambda name, share: moved(name, 0.8 * share))


def eliminate(
    records: Sequence[Record],
    growths: Mapping[str, Growth],
    counting: int,
    behind: float,
    moved: Moved = lambda name, share: None,
) -> dict[str, Fit]:
    """Fits on the whole records of those `growths` that are not eliminated. One stays while its cost is close to that
    of the best `counting`, or is that of a declared confounder of the best, and at most `behind` times the best; or
    while its cost is chance, because a model with many parameters leaves less of a short prefix. None is eliminated on
    the shortest prefix. `moved` is called with the leader and the share of the work that is done.
    """
    running, kind = dict(growths), next(iter(growths.values())).model.kind
    leader = next(iter(running))
    for number, parts in lengths(kind, records):
        moved(leader, number / (len(kind.beginnings_s) + 1))
        grown = each(partial(_longer, number, parts), list(running.values()))
        for growth, fits in zip(running.values(), grown, strict=True):
            growth.fits = fits
        costs = {name: growth.fits[0].chi2 for name, growth in running.items()}
        leader = min(costs, key=lambda name: costs[name])
        if not number:
            continue
        ranked = sorted(costs.values())
        within = SET.in_reach if number >= SET.ranked_from else SET.early_reach
        reach, limit = within * ranked[min(counting, len(costs)) - 1], behind * ranked[0]
        alike = kind.catalogue[leader].confounders
        running = {
            name: growth
            for name, growth in running.items()
            if (costs[name] <= limit and (costs[name] <= reach or name in alike)) or growth.fits[0].by_chance
        }
    return {name: growth.fits[0] for name, growth in running.items()}


def _longer(number: int, parts: Sequence[Record], growth: Growth) -> list[Fit]:
    return growth.on(number, parts).fits


def _survivors(model: FittedModel, screened: Sequence[Screened], moved: Moved) -> dict[str, Fit]:
    """Fits of `model` with each candidate of a table, good enough for a ranking: a few rounds of descent from its best
    opening, full fits of the first of these and of their confounders.
    """
    kind, bases = model.kind, begins(model.kind, model.thetas[:1])

    def begun(row: Screened) -> Fit:
        start = opening(kind, model.part, bases, row.effect, row.starts)
        fitter = Fitter.of(kind, model.part, [*model.effects, row.effect], 0)
        return fitter.near(start, SET.narrow[:1], SET.opened).bare()

    moved(screened[0].effect, 0.0)
    fits = dict(zip((row.effect for row in screened), each(begun, screened), strict=True))
    entered = _with_confounders(kind, sorted(fits, key=lambda name: fits[name].cost))
    moved(entered[0], 0.4)

    def full(name: str) -> Fit:
        return Fitter.of(kind, model.part, [*model.effects, name]).near(fits[name].theta).bare()

    return dict(zip(entered, each(full, entered), strict=True))


def shared_by(kind: Kind, name: str) -> list[str]:
    """The refinements that a candidate needs before it can be compared, and that no search names by itself: those that
    split a changed resistance between nose and slip limit.
    """
    finer = (effect for effect in REFINEMENTS if effect.id in kind.catalogue[name].refined_by)
    return [e.id for e in finer if e.answers("shared") and kind.name in e.kinds and e.id not in kind.in_base]


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
    points = []
    for start in starts:
        wanted = [start[amplitude.name], *(sign * effect.probe * k for k in _MULTIPLES for sign in (1.0, -1.0))]
        values = sorted({v for v in wanted if amplitude.lower <= v <= amplitude.upper and v != 0.0})
        points += [base.with_(name, {**start, amplitude.name: value}) for base in bases for value in values]
    costs = Fitter.of(kind, part, [name]).costs(points)
    return min(zip(costs, points, strict=True), key=itemgetter(0))[1]


def _with_confounders(kind: Kind, entered: Sequence[str]) -> list[str]:
    """The best entries and the confounders of the first few, which only a full fit separates."""
    declared = {effect.id: effect for effect in kind.effects}
    wanted = list(entered[: SET.pool])
    for name in entered[: SET.alike]:
        wanted += [other for other in declared[name].confounders if other in entered and other not in wanted]
    return wanted


def better_without(model: FittedModel, further: str, others: Fits) -> FittedModel:
    """The better of `model` and of the same refitted from the base of fits with one `further` effect, `others`."""
    again = model.near(theta.without(further) for theta in others)
    return min(model, again, key=attrgetter("training_cost"))


def fair(model: FittedModel, trials: Sequence[Trial]) -> tuple[list[Trial], FittedModel]:
    """The trials against the best fit *without* a further effect, also started from their bases; and that fit."""
    best = model
    for trial in trials[:2]:
        best = better_without(best, trial.effect, trial.thetas)
    return sorted((replace(t, before=best.blocks) for t in trials), key=lambda trial: -trial.gain), best
