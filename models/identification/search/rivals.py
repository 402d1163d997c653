"""Which other candidates explain the records as well as a named effect: each is put in its place, fitted, compared."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from models.effects.effect import Effect
from models.identification.fitting.fit import Problem, costs_of, descend
from models.identification.search.candidates import Trial, opening
from models.identification.search.fitted_model import FittedModel
from models.identification.search.growing_horizon import prefixes
from models.identification.search.own_range import within
from models.identification.search.refit import step_on
from models.identification.search.screening import Screened
from models.identification.search.validation import Array, ahead, free_run, judged, judged_cost
from models.identification.settings import SET
from models.records.record import Record


@dataclass(frozen=True)
class Rival:
    """A candidate in the place of a named effect, `fitted`: `apart`, the standard errors by which the model with the
    effect is ahead of it, on the records left out or on those fitted, whichever tells more; `alike` where the records
    cannot tell it.
    """

    effect: str
    apart: float
    alike: bool
    fitted: FittedModel


def rivals_of(
    model: FittedModel, effect: str, gain: float, screened: Sequence[Screened], trials: Sequence[Trial]
) -> list[Rival]:
    """Every candidate beside those in `model` in the place of its `effect`, which gained `gain`: from where the
    candidates' screening and `trials` have them, and those that are declared to look like the effect, or like one that
    the records cannot tell from it, from where they imitate it. What explains too little of the residual, or stays far
    behind after a short fit, is not fitted further.
    """
    own = {effect, *model.kind.catalogue[effect].refined_by}
    rest = [name for name in model.effects if name not in own]
    training, best = _training_blocks(model), dict[str, FittedModel]()
    for name, fitted in (*_screened_rivals(model, effect, own, rest, screened), *_tried_rivals(model, rest, trials)):
        if name != effect and (name not in best or fitted.cost < best[name].cost):
            best[name] = fitted
    same = model.kind.equivalents.get(effect, ())
    best = {name: _as_called(fitted, name) for name, fitted in best.items()}
    rivals = {name: _compared(model, training, name, fitted, gain, name in same) for name, fitted in best.items()}
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
            imitated = differs < SET.rival_imitated * (float(training.mean()) - 1)
            seen.add(other.id)
            rivals[other.id] = _compared(model, training, other.id, fitted, gain, imitated or other.id in same)
            if rivals[other.id].alike:
                waiting.append(other.id)
    return list(rivals.values())


def _imitation(
    model: FittedModel, made: Sequence[Sequence[Record]], other: type[Effect], own: set[str], rest: Sequence[str]
) -> tuple[FittedModel, float]:
    """A fit of the effect `other` in the place of those in `own`, from where it predicts what the model predicts for
    the same inputs, the records `made`, a part of each split; and the mean square by which it then differs from it, in
    units of the noise. Free of noise and of everything that neither effect has, an equal form ends right there, however
    far off another search ended.
    """
    kind, effects, fits, differs = model.kind, [*rest, other.id], [], []
    for (part, theta), predicted in zip(model.parts, made, strict=True):
        base = theta.without(*own)
        _, start = opening(kind, prefixes(predicted[:1], kind.beginnings_s[-1]), [base], other.id, other.start())
        near = step_on(kind, predicted, effects, start)
        differs.append(judged_cost(kind, predicted, near.theta))
        fits.append(step_on(kind, part, effects, near.theta).theta)
    fitted = model.fitted(fits, effects)
    called = _as_called(fitted, other.id)
    return called, max(differs) if called is fitted else float("inf")


def _as_called(fitted: FittedModel, effect: str) -> FittedModel:
    """The fit where its `effect` is what it is called."""
    moved = within(fitted.kind, fitted.splits, fitted.effects, effect, fitted.thetas)
    return fitted if moved is None else fitted.fitted(moved)


def _screened_rivals(
    model: FittedModel, effect: str, own: set[str], rest: Sequence[str], screened: Sequence[Screened]
) -> Iterator[tuple[str, FittedModel]]:
    """Local fits from where screening would start, of the candidates that a short one brings near: of time series
    one to the first record's longest beginning.
    """
    kind, criterion = model.kind, free_run(model.kind)
    part = prefixes(model.part[:1], kind.beginnings_s[-1]) if kind.beginnings_s else model.part
    bases = [theta.without(*own) for theta in model.thetas]
    share = max((row.share for row in screened if row.effect == effect), default=0.0)
    near = [
        row for row in screened if row.effect not in (*own, *rest) and row.starts and row.share >= SET.rival_has * share
    ]
    limit = SET.behind * costs_of(kind, part, [model.thetas[0]], criterion)[0]
    begun = []
    for row in near[: 2 * SET.pool]:
        _, point = min((opening(kind, part, bases[:1], row.effect, start) for start in row.starts), key=lambda o: o[0])
        fit = descend(Problem.of(kind, part, [*rest, row.effect], criterion), point, SET.narrow[0], 3)
        if fit.cost <= limit:
            begun.append((fit.cost, row.effect, fit.theta))
    for _, name, theta in sorted(begun, key=lambda entry: entry[0])[: 2 * SET.final]:
        starts = [theta, *(base.with_(name, theta.effects[name]) for base in bases[1:])]
        ends = [
            step_on(kind, records, [*rest, name], start).theta
            for (records, _), start in zip(model.splits, starts, strict=True)
        ]
        yield name, model.fitted(ends, [*rest, name])


def _tried_rivals(
    model: FittedModel, rest: Sequence[str], trials: Sequence[Trial]
) -> Iterator[tuple[str, FittedModel]]:
    """Fits that the search made of candidates beside the same other effects, also with their refinements."""
    for trial in trials:
        if set(rest) == set(trial.thetas[0].effects) - {trial.effect, *model.kind.in_base}:
            yield trial.effect, model.fitted(trial.thetas, [*rest, trial.effect])
            for effects, fits in trial.refinements.items():
                yield trial.effect, model.fitted(fits, effects)


def _compared(model: FittedModel, training: Array, name: str, fitted: FittedModel, gain: float, same: bool) -> Rival:
    """Alike where the difference is chance, or so small that it tells a finer shape and no other effect, or where the
    rival is the `same` to these records: it imitates the effect, or no form tells it. Catalogue forms leave up to 0.3 %
    of the power of an effect whose form is another (docs/results/identification.md).
    """
    on_training = _training_blocks(fitted)
    behind = float(np.log(fitted.cost / model.cost))
    apart = max(ahead(model.blocks, fitted.blocks), ahead(training, on_training))
    finer = max(SET.told, float(np.log1p(SET.rival_form * np.expm1(gain))))
    small = max(behind, float(np.log(on_training.sum() / training.sum()))) < finer
    return Rival(name, apart, bool(same or (behind < SET.rival_gain * gain and (apart < SET.apart or small))), fitted)


def _training_blocks(model: FittedModel) -> Array:
    return np.concatenate([judged(model.kind, part, theta) for part, theta in model.parts])
