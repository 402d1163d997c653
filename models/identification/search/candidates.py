"""Which candidate it is: joint fits by successive elimination, the better ones going on to a longer stretch, the last
ones judged on validation records.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from models.effects import CATALOGUE, REFINEMENTS
from models.identification.fitting.fit import Fit, Problem, costs_of, descend, narrowing
from models.identification.kind import Kind
from models.identification.search.fitted_model import Fits, FittedModel
from models.identification.search.growing_horizon import FROM_CLOSE, QUICK, GrowingHorizon, base_known, eliminate
from models.identification.search.own_range import within
from models.identification.search.refit import begins, refit, step_on
from models.identification.search.screening import Screened
from models.identification.search.validation import ahead, block_costs, free_run, judged, judged_cost
from models.identification.settings import SET
from models.parameter import Name
from models.records.record import Record
from models.theta import Theta

Moved = Callable[[str, float], None]


def _quiet(name: str, share: float) -> None:
    pass


_MULTIPLES = tuple(2.0**k for k in range(6))


@dataclass(frozen=True)
class Trial:
    """A model with one more effect: what it adds on validation records, `gain` = ln(cost without/cost with), and its
    drop for each residual; `thetas` are the fits, one a split, `blocks` the validation cost by block for comparing
    trials, and `refinements` the fits of the models with the refinements of the effect that were made on the way.
    """

    effect: str
    thetas: tuple[Theta, ...]
    gain: float
    drop: float
    blocks: np.ndarray
    refinements: Mapping[tuple[str, ...], list[Theta]] = field(default_factory=dict)


def compare_candidates(model: FittedModel, screened: Sequence[Screened], moved: Moved = _quiet) -> list[Trial]:
    """Joint fits of `model` with one more effect, from short ones of every candidate to full ones of the best three and
    of the declared confounded effects of the best; best gain first. None where no candidate passed the screening.
    `moved` hears of each candidate that comes next, and the share of the work that is done.
    """
    if not screened:
        return []
    if model.kind.beginnings_s:
        fitted = _grown(model, screened, moved)
    else:
        fitted = _survivors(model, _entries(model, screened, moved), moved)
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
    trials = from_the_best(model, trials, helped) if model.kind.beginnings_s else helped
    trials = [_as_called(model, trial) for trial in trials]
    return sorted(trials, key=lambda trial: -trial.gain)


def _as_called(model: FittedModel, trial: Trial) -> Trial:
    """The trial where its effect is what it is called."""
    moved = within(model.kind, model.splits, [*model.effects, trial.effect], trial.effect, trial.thetas)
    if moved is None:
        return trial
    return against(model.blocks, trial.effect, moved, block_costs(model.kind, model.splits, moved))


def _refinements(kind: Kind, name: str) -> list[str]:
    """What may have to stand beside a candidate before it can be told: of what refines it, what is in the catalogue
    itself and what says how much of a changed resistance the slip limit feels.
    """
    known = {effect.id for effect in kind.effects}
    return [
        c
        for c in kind.catalogue[name].refined_by
        if c in known
        or (kind.catalogue[c].answers("shared") and kind.name in kind.catalogue[c].kinds and c not in kind.in_base)
    ]


def _with_refinements(so_far: FittedModel, trial: Trial, sought: Theta | None) -> Trial:
    """`trial` as its refinements would leave it, also from where its elimination round `sought` it, where that is
    better: of two candidates of which neither is quite right, the one that its refinements complete. It has none
    where nothing was `sought`. One without refinements is looked for from more places where it leaves more than the
    noise.
    """
    kind, splits = so_far.kind, so_far.splits
    refinements = [c for c in _refinements(kind, trial.effect) if c not in so_far.effects] if sought else []
    if not refinements and not kind.beginnings_s:
        return trial
    model = [*so_far.effects, trial.effect, *refinements]
    fits = []
    for (part, _), theta in zip(splits, trial.thetas, strict=True):
        ends = [refit(kind, part, model, start) for start in (theta, *([sought] if refinements and sought else []))]
        fits.append(min(ends, key=lambda end: judged_cost(kind, part, end)))
    again = against(so_far.blocks, trial.effect, tuple(fits), block_costs(kind, splits, fits))
    if not refinements:
        return again
    trial = replace(trial, refinements={tuple(model): fits})
    return replace(trial, gain=again.gain, drop=again.drop, blocks=again.blocks) if again.gain > trial.gain else trial


def from_the_best(model: FittedModel, alone: Sequence[Trial], helped: Sequence[Trial]) -> list[Trial]:
    """The `helped` trials, the confounded effects of the best one and its refinements from the catalogue also fitted
    from where it has its base: none may win by a luckier search. Where such a refinement does about as well without the
    best one, that is judged as it is `alone`.
    """
    kind, splits, effects = model.kind, model.splits, model.effects
    rows = {trial.effect: trial for trial in helped}
    if not rows:
        return []
    best = max(helped, key=lambda trial: trial.gain)
    both = next(iter(best.refinements.values()), None)
    beside = [c for c in _refinements(kind, best.effect) if kind.catalogue[c] not in REFINEMENTS] if both else []
    alike = [name for name in rows if kind.catalogue[best.effect].looks_like(kind.catalogue[name])]
    for name in dict.fromkeys((*beside, *alike)):
        owns = both if both and name in beside else rows[name].thetas
        starts = [
            base.only({*effects, *kind.in_base}).with_(name, own.effects[name])
            for base, own in zip(both or best.thetas, owns, strict=True)
        ]
        fits = tuple(
            step_on(kind, part, [*effects, name], s).theta for (part, _), s in zip(splits, starts, strict=True)
        )
        again = against(model.blocks, name, fits, block_costs(kind, splits, fits))
        if name not in rows or again.gain > rows[name].gain:
            rows[name] = again
        if name in beside and (
            rows[name].gain > best.gain - SET.shaped or ahead(best.blocks, rows[name].blocks) < SET.apart
        ):
            rows[best.effect] = next(trial for trial in alone if trial.effect == best.effect)
    return list(rows.values())


def _grown(model: FittedModel, screened: Sequence[Screened], moved: Moved) -> dict[str, Fit]:
    """Fits of `model` with each candidate on ever longer beginnings, from where the screening and either base have it,
    one that changes the resistance also from where the slip limit does not follow it; without those that fell behind
    on the way.
    """
    kind = model.kind
    effort = FROM_CLOSE if base_known(kind) else QUICK
    climbs = {}
    for row in screened:
        beside = shared_by(kind, row.effect)
        starts = [
            place
            for base in begins(kind, model.thetas[0])
            for start in row.starts
            for place in with_each(base.with_(row.effect, start), beside)
        ]
        effects = [*model.effects, row.effect, *beside]
        climbs[row.effect] = GrowingHorizon(kind, effects, starts, effort, row.effect)
    return eliminate(model.part, climbs, SET.final, SET.behind, lambda name, share: moved(name, 0.8 * share))


def _entries(model: FittedModel, screened: Sequence[Screened], moved: Moved) -> dict[str, Theta]:
    """Where the fit of each candidate may start, the best candidate first: one round of descent from its best opening
    at the kind's first criterion, and a few more of those candidates that came lowest by it.
    """
    kind, bases = model.kind, begins(model.kind, model.thetas[0])

    def descended(name: str, start: Theta, rounds: int) -> Fit:
        return descend(Problem.of(kind, model.part, [*model.effects, name], 0), start, SET.narrow[0], rounds)

    fits = {}
    for k, row in enumerate(screened):
        moved(row.effect, 0.3 * k / len(screened))
        _, place = min((opening(kind, model.part, bases, row.effect, start) for start in row.starts), key=_first)
        fits[row.effect] = descended(row.effect, place, 1)
    lowest = sorted(fits, key=lambda name: fits[name].cost)[: SET.entered]
    for k, name in enumerate(lowest):
        moved(name, 0.3 + 0.1 * k / len(lowest))
        fits[name] = descended(name, fits[name].theta, SET.entered_rounds)
    return {name: fits[name].theta for name in sorted(fits, key=lambda name: fits[name].cost)}


def _first(row: tuple[float, Theta]) -> float:
    return row[0]


def _survivors(model: FittedModel, entries: Mapping[str, Theta], moved: Moved) -> dict[str, Fit]:
    """Fits of `model` with the first of `entries` and their confounded effects, good enough to rank by."""
    kind = model.kind
    fits = {}
    entered = _with_confounders(kind, list(entries))
    for k, name in enumerate(entered):
        moved(name, 0.4 + 0.4 * k / len(entered))
        problem = Problem.of(kind, model.part, [*model.effects, name], free_run(kind))
        fits[name] = narrowing(problem, entries[name], SET.narrow, 8)
    return fits


def shared_by(kind: Kind, name: str) -> list[str]:
    """Of what may have to stand beside a candidate, what no search names by itself."""
    return [c for c in _refinements(kind, name) if kind.catalogue[c] in REFINEMENTS]


def with_each(start: Theta, refinements: Sequence[str]) -> list[Theta]:
    """`start`, and with each shape on the refinements' grids."""
    grid: dict[Name, tuple[float, ...]]
    grid = {(c, name): values for c in refinements for name, values in CATALOGUE[c].grid.items()}
    rows = itertools.product(*grid.values())
    return [start, *(start | dict(zip(grid, row, strict=True)) for row in rows if row)]


def opening(
    kind: Kind, part: Sequence[Record], bases: Sequence[Theta], name: str, start: Mapping[str, float]
) -> tuple[float, Theta]:
    """Cost and place of the best amplitude of the effect `name` in the shape `start` at the best of `bases` (a
    calibration may have bent the base to make up for what was missing).
    """
    effect = next(e for e in kind.effects if e.id == name)
    amplitude = effect.amplitude()
    wanted = [start[amplitude.name], *(sign * effect.probe * k for k in _MULTIPLES for sign in (1.0, -1.0))]
    values = sorted({v for v in wanted if amplitude.lower <= v <= amplitude.upper and v != 0.0})
    points = [base.with_(name, {**start, amplitude.name: value}) for base in bases for value in values]
    costs = costs_of(kind, part, points, free_run(kind))
    return min(zip(costs, points, strict=True), key=_first)


def _with_confounders(kind: Kind, entered: Sequence[str]) -> list[str]:
    """The best entries and the declared confounded effects of the first few: they share a residual and only a full fit
    tells them apart.
    """
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
    effects = [*model.effects, name]
    fits = tuple(refit(kind, part, effects, s, np.inf) for (part, _), s in zip(model.splits, starts, strict=True))
    return against(model.blocks, name, fits, block_costs(kind, model.splits, fits))


def against(before: np.ndarray, name: str, fits: tuple[Theta, ...], after: np.ndarray) -> Trial:
    """The trial of the effect `name` with `fits`: validation costs by block `before` it and `after`."""
    gain = float(np.log(before.sum() / max(after.sum(), 1e-300)))
    return Trial(name, fits, gain, float(before.mean() - after.mean()), after)


def better_without(model: FittedModel, further: str, others: Fits) -> FittedModel:
    """The better on the training records of `model` and of the same begun where `others`, fits with one `further`
    effect, have their base and the effects.
    """
    starts = [theta.without(further) for theta in others]
    again = [
        step_on(model.kind, part, model.effects, start).theta
        for (part, _), start in zip(model.splits, starts, strict=True)
    ]
    return min(model, model.fitted(again), key=lambda choice: choice.training_cost)


def fair(model: FittedModel, trials: Sequence[Trial]) -> tuple[list[Trial], FittedModel]:
    """The trials judged again against the best fit *without* a further effect, looked for from the trials' own base
    values too: a trial must not win because its search was luckier with the base. That fit is the second value.
    """
    best = model
    for trial in trials[:2]:
        best = better_without(best, trial.effect, trial.thetas)
    again = [replace(against(best.blocks, t.effect, t.thetas, t.blocks), refinements=t.refinements) for t in trials]
    return sorted(again, key=lambda trial: -trial.gain), best
