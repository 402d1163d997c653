"""Which other candidates explain the records as well as a named effect: each replaces it, is fitted and compared."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np

from models.effects.effect import Effect
from models.identification.fitting.fit import Fit, costs_of, judged_cost
from models.identification.fitting.fitter import Fitter
from models.identification.fitting.horizon import QUICK, prefixes
from models.identification.search.candidates import Trial, opening
from models.identification.search.fitted_model import FittedModel, ahead
from models.identification.search.screening import Screened
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta
from models.workers import each


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
    further; the closest are fitted from anywhere and from the model's own base.
    """
    kind, own = model.kind, {effect, *model.kind.catalogue[effect].refined_by}
    rest = [name for name in model.effects if name not in own]
    best = dict[str, FittedModel]()
    for name, fitted in (*_screened_rivals(model, effect, own, rest, screened), *_tried_rivals(model, rest, trials)):
        if name != effect and (name not in best or fitted.cost < best[name].cost):
            best[name] = fitted
    same = kind.equivalents.get(effect, ())
    closest = sorted(best, key=lambda name: best[name].cost)[: SET.final]
    best |= dict(zip(closest, each(lambda name: _anywhere(model, name, best[name], own), closest), strict=True))
    rivals = {
        name: _compared(model, name, fitted.within_name(name), gain, name in same) for name, fitted in best.items()
    }
    if not kind.beginnings_s:
        return list(rivals.values())
    made = [
        [record.with_column(kind.quantity, kind.predict(record, theta)) for record in part]
        for part, theta in model.parts
    ]

    def imitated(other: type[Effect]) -> Rival:
        fitted, differs = _imitation(model, made, other, own, rest)
        fitted = min((fitted, best.get(other.id, fitted)), key=lambda one: one.cost)
        close = differs < SET.rival_imitated * (float(model.training_blocks.mean()) - 1)
        return _compared(model, other.id, fitted, gain, close or other.id in same)

    waiting, seen = [effect, *(name for name, rival in rivals.items() if rival.alike)], {*own, *rest, effect}
    seen |= set(waiting)
    while waiting:
        alike = [e for e in kind.effects if e.id not in seen and any(e.looks_like(kind.catalogue[w]) for w in waiting)]
        found = each(imitated, alike)
        rivals |= {rival.effect: rival for rival in found}
        seen |= {rival.effect for rival in found}
        waiting = [rival.effect for rival in found if rival.alike]
    return list(rivals.values())


def _anywhere(model: FittedModel, name: str, fitted: FittedModel, own: set[str]) -> FittedModel:
    """The better of the rival `fitted` and of the same from anywhere, also from the base of the `model` without its
    `own` effect: of the two none may win by a luckier search.
    """
    pairs = zip(fitted.thetas, model.thetas, strict=True)
    starts = ([theta, base.without(*own).with_(name, theta.effects[name])] for theta, base in pairs)
    return min((fitted, fitted.far(starts, effort=QUICK)), key=lambda one: one.cost)


def _imitation(
    model: FittedModel, made: Sequence[Sequence[Record]], other: type[Effect], own: set[str], rest: Sequence[str]
) -> tuple[FittedModel, float]:
    """A fit of the effect `other` in place of those in `own`, started from its fit to the model's own predictions, the
    records `made`, a part of each split; and the mean square of that fit's residual in units of the noise. Without
    noise and misfit an equal form fits exactly, however far off another search ended.
    """
    kind, effects, fits, differs = model.kind, [*rest, other.id], [], []
    for theta, predicted in zip(model.thetas, made, strict=True):
        begun = prefixes(predicted[:1], kind.beginnings_s[-1])
        start = opening(kind, begun, [theta.without(*own)], other.id, [other.start()])
        near = Fitter.of(kind, predicted, effects).near(start).theta
        differs.append(judged_cost(kind, predicted, near))
        fits.append(near)
    fitted = model.near(fits, effects)
    called = fitted.within_name(other.id)
    return called, max(differs) if called is fitted else float("inf")


def _screened_rivals(
    model: FittedModel, effect: str, own: set[str], rest: Sequence[str], screened: Sequence[Screened]
) -> list[tuple[str, FittedModel]]:
    """Short fits from the screening starts, for time series on one record's longest prefix, then full ones."""
    kind = model.kind
    part = prefixes(model.part[:1], kind.beginnings_s[-1]) if kind.beginnings_s else model.part
    bases = [theta.without(*own) for theta in model.thetas]
    share = max((row.share for row in screened if row.effect == effect), default=0.0)
    near = [
        row for row in screened if row.effect not in (*own, *rest) and row.starts and row.share >= SET.rival_has * share
    ]
    limit = SET.behind * costs_of(kind, part, [model.thetas[0]], kind.free_run)[0]

    def begun(row: Screened) -> Fit:
        point = opening(kind, part, bases[:1], row.effect, row.starts)
        return Fitter.of(kind, part, [*rest, row.effect]).near(point, SET.narrow[:1], SET.opened).bare()

    rows = near[: 2 * SET.pool]
    fits = [(fit.cost, row.effect, fit.theta) for row, fit in zip(rows, each(begun, rows), strict=True)]
    close = sorted((fit for fit in fits if fit[0] <= limit), key=itemgetter(0))[: 2 * SET.final]

    def fitted(entry: tuple[float, str, Theta]) -> FittedModel:
        _, name, theta = entry
        return model.near([theta, *(base.with_(name, theta.effects[name]) for base in bases[1:])], [*rest, name])

    return list(zip((name for _, name, _ in close), each(fitted, close), strict=True))


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
