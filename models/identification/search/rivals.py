"""Which other candidates explain the records as well as a named effect: each replaces it, is fitted and compared."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from models.effects.effect import Effect
from models.identification.fitting.fit import Problem, costs_of
from models.identification.search.candidates import Trial, opening
from models.identification.search.fitted_model import FittedModel, ahead, judged_cost
from models.identification.search.growing_horizon import prefixes
from models.identification.search.refit import as_called, stepped
from models.identification.search.screening import Screened
from models.identification.settings import SET
from models.records.record import Record


@dataclass(frozen=True)
class Rival:
    """A candidate that replaces a named effect, `fitted`: `apart`, the standard errors by which the model with the
    effect leads, on validation or training records, whichever is more; `alike` where the records do not separate the
    two.
    """

    effect: str
    apart: float
    alike: bool
    fitted: FittedModel


def rivals_of(
    model: FittedModel, effect: str, gain: float, screened: Sequence[Screened], trials: Sequence[Trial]
) -> list[Rival]:
    """Every candidate beside those in `model` that could replace its `effect`, which gained `gain`: from the starts of
    screening and `trials`; declared confounders of the effect, or of one that the records do not separate from it, also
    from where they imitate it. A candidate that explains too little, or is far behind after a short fit, is not fitted
    further.
    """
    own = {effect, *model.kind.catalogue[effect].refined_by}
    rest = [name for name in model.effects if name not in own]
    best = dict[str, FittedModel]()
    for name, fitted in (*_screened_rivals(model, effect, own, rest, screened), *_tried_rivals(model, rest, trials)):
        if name != effect and (name not in best or fitted.cost < best[name].cost):
            best[name] = fitted
    same = model.kind.equivalents.get(effect, ())
    best = {name: as_called(fitted, name) for name, fitted in best.items()}
    rivals = {name: _compared(model, name, fitted, gain, name in same) for name, fitted in best.items()}
    if not model.kind.beginnings_s:
        return list(rivals.values())
    made = [
        [record.with_column(model.kind.quantity, model.kind.predict(record, theta)) for record in part]
        for part, theta in model.parts
    ]
    alike = [name for name, rival in rivals.items() if rival.alike]
    waiting, seen = [effect, *alike], {*own, *rest, *alike}
    while waiting:
        like = waiting.pop(0)
        for other in (e for e in model.kind.effects if e.id not in seen and e.looks_like(model.kind.catalogue[like])):
            fitted, differs = _imitation(model, made, other, own, rest)
            fitted = min((fitted, best.get(other.id, fitted)), key=lambda one: one.cost)
            imitated = differs < SET.rival_imitated * (float(model.training_blocks.mean()) - 1)
            seen.add(other.id)
            rivals[other.id] = _compared(model, other.id, fitted, gain, imitated or other.id in same)
            if rivals[other.id].alike:
                waiting.append(other.id)
    return list(rivals.values())


def _imitation(
    model: FittedModel, made: Sequence[Sequence[Record]], other: type[Effect], own: set[str], rest: Sequence[str]
) -> tuple[FittedModel, float]:
    """A fit of the effect `other` in place of those in `own`, started from its fit to the model's own predictions, the
    records `made`, a part of each split; and the mean square of that fit's residual in units of the noise. Without
    noise and misfit an equal form fits exactly, however far off another search ended.
    """
    kind, effects, fits, differs = model.kind, [*rest, other.id], [], []
    for (part, theta), predicted in zip(model.parts, made, strict=True):
        begun = prefixes(predicted[:1], kind.beginnings_s[-1])
        start = opening(kind, begun, [theta.without(*own)], other.id, [other.start()])
        near = stepped(kind, predicted, effects, start)
        differs.append(judged_cost(kind, predicted, near))
        fits.append(stepped(kind, part, effects, near))
    fitted = model.fitted(fits, effects)
    called = as_called(fitted, other.id)
    return called, max(differs) if called is fitted else float("inf")


def _screened_rivals(
    model: FittedModel, effect: str, own: set[str], rest: Sequence[str], screened: Sequence[Screened]
) -> Iterator[tuple[str, FittedModel]]:
    """Short fits from the screening starts, for time series on one record's longest prefix, then full ones."""
    kind = model.kind
    part = prefixes(model.part[:1], kind.beginnings_s[-1]) if kind.beginnings_s else model.part
    bases = [theta.without(*own) for theta in model.thetas]
    share = max((row.share for row in screened if row.effect == effect), default=0.0)
    near = [
        row for row in screened if row.effect not in (*own, *rest) and row.starts and row.share >= SET.rival_has * share
    ]
    limit = SET.behind * costs_of(kind, part, [model.thetas[0]], kind.free_run)[0]
    begun = []
    for row in near[: 2 * SET.pool]:
        point = opening(kind, part, bases[:1], row.effect, row.starts)
        fit = Problem.of(kind, part, [*rest, row.effect]).descend(point, SET.narrow[0], 3)
        if fit.cost <= limit:
            begun.append((fit.cost, row.effect, fit.theta))
    for _, name, theta in sorted(begun, key=lambda entry: entry[0])[: 2 * SET.final]:
        starts = [theta, *(base.with_(name, theta.effects[name]) for base in bases[1:])]
        yield name, model.refitted(stepped, starts, [*rest, name])


def _tried_rivals(
    model: FittedModel, rest: Sequence[str], trials: Sequence[Trial]
) -> Iterator[tuple[str, FittedModel]]:
    """Fits that the search made of candidates beside the same other effects, also with their refinements."""
    for trial in trials:
        if set(rest) == set(trial.thetas[0].effects) - {trial.effect, *model.kind.in_base}:
            yield trial.effect, model.fitted(trial.thetas, [*rest, trial.effect])
            for effects, fits in trial.refinements.items():
                yield trial.effect, model.fitted(fits, effects)


def _compared(model: FittedModel, name: str, fitted: FittedModel, gain: float, same: bool) -> Rival:
    """Alike where the difference is chance, or so small that it may be an error of the form, or where the rival is the
    `same` for these records: it imitates the effect, or no form separates it. The forms of the catalogue miss up to
    0.3 % of the power of an effect of another form (docs/results/identification.md).
    """
    training, on_training = model.training_blocks, fitted.training_blocks
    behind = float(np.log(fitted.cost / model.cost))
    apart = max(ahead(model.blocks, fitted.blocks), ahead(training, on_training))
    finer = max(SET.finer_gain, float(np.log1p(SET.rival_form * np.expm1(gain))))
    small = max(behind, float(np.log(on_training.sum() / training.sum()))) < finer
    return Rival(name, apart, bool(same or (behind < SET.rival_gain * gain and (apart < SET.apart or small))), fitted)
