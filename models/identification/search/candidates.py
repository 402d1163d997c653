"""Comparison of candidates: joint fits by successive elimination, the finalists judged on validation records."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter, methodcaller

import numpy as np

from models.effects import CATALOGUE, REFINEMENTS
from models.identification.fitting.fit import Fit
from models.identification.fitting.fitter import Fitter, Growth, begins
from models.identification.fitting.horizon import lengths
from models.identification.kind import Array, Kind
from models.identification.search.fitted_model import FittedModel, fewest
from models.identification.search.screening import Screened
from models.identification.settings import SET
from models.parameter import Name
from models.records.record import Record
from models.theta import Theta
from models.workers import each

Moved = Callable[[str, float], None]


@dataclass(frozen=True)
class Trial:
    """A model with one more `effect`, `fitted`, also with refinements (`finer`), beside the cost `before`."""

    effect: str
    fitted: FittedModel
    before: Array
    finer: FittedModel | None = None

    @property
    def model(self) -> FittedModel:
        """That of both to go on with: without the refinements, where it does about as well."""
        rows = [self.fitted, *([self.finer] if self.finer else [])]
        return rows[fewest([row.blocks for row in rows], [row.training_cost for row in rows])]

    @property
    def blocks(self) -> Array:
        """Validation cost by block, with the refinements where they help."""
        return min((one.blocks for one in (self.fitted, self.finer) if one), key=np.sum)

    @property
    def gain(self) -> float:
        """What it adds on validation records: `ln(cost without/cost with)`."""
        return float(np.log(self.before.sum() / max(self.blocks.sum(), SET.tiny)))


def compare_candidates(model: FittedModel, screened: Sequence[Screened], moved: Moved) -> list[Trial]:
    """Joint fits of `model` with one more effect: short ones of every candidate, full ones of the best three and of the
    best one's confounders. `moved` hears of the leader and of the share of the work that is done.
    """
    if not screened:
        return []
    kind, growths = model.kind, {row.effect: _growth(model, row) for row in screened}
    sought = eliminate(model.part, growths, lambda name, share: moved(name, 0.8 * share))
    ranking = sorted(sought, key=lambda name: sought[name].cost)
    alike, most = kind.catalogue[ranking[0]].confounders, SET.behind * sought[ranking[0]].cost
    names = [n for k, n in enumerate(ranking) if sought[n].cost <= most and (k < SET.final or n in alike)]

    def near(name: str) -> FittedModel:
        start = sought[name].theta
        rest = (theta.with_(name, start.effects[name]) for theta in model.thetas[1:])
        return model.near([start, *rest], [*model.effects, name])

    def far(trial: Trial, beside: Sequence[str] = ()) -> FittedModel:
        starts = ([theta, sought[trial.effect].theta] for theta in trial.fitted.thetas)
        return model.far(starts, [*trial.fitted.effects, *beside], seeds=1)

    moved(names[0], 0.8)
    trials = [Trial(name, fit, model.blocks) for name, fit in zip(names, model.each(near, names), strict=True)]
    if min(trial.fitted.cost for trial in trials) > SET.near:
        moved(names[0], 0.9)
        if kind.beginnings_s:
            pairs = zip(trials, model.each(far, trials), strict=True)
            trials = [replace(t, fitted=min(t.fitted, fit, key=attrgetter("cost"))) for t, fit in pairs]
        unclear = [t for t in trials if shared_by(kind, t.effect, model.effects) and t.fitted.cost > SET.near]
        finer = model.each(lambda t: far(t, shared_by(kind, t.effect, model.effects)), unclear)
        shaped = dict(zip((t.effect for t in unclear), finer, strict=True))
        trials = [replace(t, finer=shaped.get(t.effect)) for t in trials]
    return trials


def _growth(model: FittedModel, row: Screened) -> Growth:
    """Fits of `model` with a candidate from its screening starts on either base, with and without what it shares."""
    beside = shared_by(model.kind, row.effect, model.effects)
    points = (at.with_(row.effect, start) for at in begins(model.kind, model.thetas[:1]) for start in row.starts)
    starts = [start for point in points for start in with_each(point, beside)]
    return Growth(Fitter.of(model.kind, model.part, [*model.effects, row.effect, *beside]).plain(), starts)


def eliminate(
    records: Sequence[Record], growths: Mapping[str, Growth], moved: Moved, behind: float = SET.behind
) -> dict[str, Fit]:
    """Fits on the whole records of those `growths` that are not eliminated. One stays while its cost is close to that
    of the best few, or is that of a declared confounder of these, and at most `behind` times the best; or while its
    cost is chance, because a model with many parameters leaves less of a short prefix. All stay on the shortest.
    """
    running, kind = dict(growths), next(iter(growths.values())).model.kind
    leader = next(iter(running))
    for number, parts in lengths(kind, records):
        moved(leader, number / len(SET.kept))
        grown = each(methodcaller("on", number, parts), list(running.values()))
        for growth, fits in zip(running.values(), grown, strict=True):
            growth.fits = fits
        costs = {name: growth.fits[0].chi2 for name, growth in running.items()}
        leader, *few = sorted(costs, key=lambda name: costs[name])[: SET.final]
        if not number:
            continue
        within = SET.in_reach if number >= SET.ranked_from else SET.early_reach
        reach, limit = within * costs[[leader, *few][-1]], behind * costs[leader]
        alike = {other for name in (leader, *few) for other in kind.catalogue[name].confounders}
        running = {
            name: growth
            for name, growth in running.items()
            if (costs[name] <= limit and (costs[name] <= reach or name in alike)) or growth.fits[0].by_chance
        }
    return {name: growth.fits[0] for name, growth in running.items()}


def shared_by(kind: Kind, name: str, model: Sequence[str] = ()) -> list[str]:
    """The refinements that a candidate needs beside the effects of a `model` before it can be compared, and that no
    search names by itself: those that split a changed resistance between nose and slip limit.
    """
    taken = {*model, *kind.in_base}
    finer = (effect for effect in REFINEMENTS if effect.id in kind.catalogue[name].refined_by)
    return [e.id for e in finer if e.answers("shared") and kind.name in e.kinds and e.id not in taken]


def with_each(start: Theta, refinements: Sequence[str]) -> list[Theta]:
    """`start`, and with each shape on the refinements' grids."""
    grid: dict[Name, tuple[float, ...]] = {(c, n): v for c in refinements for n, v in CATALOGUE[c].grid.items()}
    rows = itertools.product(*grid.values())
    return [start, *(start | dict(zip(grid, row, strict=True)) for row in rows if row)]


def better_without(model: FittedModel, further: str, others: Sequence[Theta]) -> FittedModel:
    """The better of `model` and of the same refitted from the base of fits with one `further` effect, `others`."""
    again = model.near(theta.without(further) for theta in others)
    return min(model, again, key=attrgetter("training_cost"))


def fair(model: FittedModel, trials: Sequence[Trial]) -> tuple[list[Trial], FittedModel]:
    """`trials`, best gain first, and `model`, against which they gain, so that none leads by a luckier search: each is
    also fitted from the base of the best of them, and the model without a further effect from those of the first few.
    """
    if not trials:
        return [], model
    leader = max(trials, key=attrgetter("gain"))

    def again(trial: Trial) -> FittedModel:
        pairs = zip(leader.fitted.thetas, trial.fitted.thetas, strict=True)
        starts = (base.without(leader.effect).with_(trial.effect, own.effects[trial.effect]) for base, own in pairs)
        return min(trial.fitted, model.near(starts, trial.fitted.effects), key=attrgetter("cost"))

    others = [trial for trial in trials if trial is not leader]
    shared = [leader, *(replace(t, fitted=fit) for t, fit in zip(others, model.each(again, others), strict=True))]
    shared.sort(key=lambda trial: -trial.gain)
    for trial in shared[: SET.compared]:
        model = better_without(model, trial.effect, trial.fitted.thetas)
    return [replace(trial, before=model.blocks) for trial in shared], model
