"""Which other candidates explain the records as well as a named effect: each replaces it, is fitted and compared."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np

from models.identification.fitting.fit import judged_cost
from models.identification.fitting.fitter import Fitter
from models.identification.fitting.horizon import prefixes
from models.identification.kind import Kind
from models.identification.search.candidates import Trial
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
    model: FittedModel, effect: str, gain: float, screened: Sequence[Screened], trials: Sequence[Trial], chance: float
) -> list[Rival]:
    """Every candidate that could replace the `effect` of `model`, which gained `gain`: those that explained much when
    screened, those of `trials`, and the declared look-alikes of the effect and, where it explains the records, of any
    that they do not separate from it. Each is fitted from anywhere, also from the model's own base and from where it
    imitates the model; of a record without prefixes to the first split alone, where that leaves far more. `chance` is
    the validation cost of a right model.
    """
    kind, named = model.kind, model.kind.catalogue
    own = {effect, *(name for name in model.effects if name in named[effect].refined_by)}
    rest = [name for name in model.effects if name not in own]
    tried = {trial.effect: trial for trial in trials if {*trial.fitted.effects} <= {trial.effect, effect, *rest}}
    share = max((row.share for row in screened if row.effect == effect), default=0.0)
    strong = [row.effect for row in screened if row.starts and row.share >= SET.rival_has * share][: SET.pool]
    starts = {row.effect: row.starts for row in screened}
    made = [part for part, _ in model.splits]
    if kind.beginnings_s:  # as the model predicts them
        made = [[kind.made(record, theta) for record in part] for part, theta in model.parts]

    hopeless = max(SET.rival_near, float(np.exp(SET.rival_gain * gain)))
    first = replace(model, splits=model.splits[:1], thetas=model.thetas[:1])
    equals = kind.equivalents.get(effect, ())

    def rival(name: str) -> tuple[float, bool, Sequence[Theta], Sequence[str]]:
        effects = [*rest, name]
        known = tried[name].fitted.thetas if name in tried else ()

        def imitated(k: int) -> tuple[Theta, float]:
            return _imitation(kind, made[k], model.thetas[k].without(*own), effects, starts.get(name, ()))

        pairs = [imitated(0)]
        begun = first.far([[pairs[0][0], *known[:1]]], effects, seeds=0)
        if begun.training_cost > hopeless * first.training_cost and not kind.beginnings_s and name not in equals:
            return np.inf, False, (), effects
        pairs += [imitated(k) for k in range(1, len(made))]
        points = [[near, *known[k : k + 1]] for k, (near, _) in enumerate(pairs) if k]
        others = replace(model, splits=model.splits[1:], thetas=()).far(points, effects, seeds=0)
        fitted = model.fitted([*begun.thetas, *others.thetas], effects)
        if fitted.training_cost <= SET.rival_near * model.training_cost:
            fitted = fitted.far(([theta] for theta in fitted.thetas), seeds=1)
        finer = tried[name].finer if name in tried else None
        fitted = min(fitted, finer or fitted, key=attrgetter("cost"))
        close = max(differs for _, differs in pairs) < SET.rival_imitated * (float(model.training_blocks.mean()) - 1)
        apart, alike = _compared(model, fitted, gain, chance)
        same = alike or close or name in equals
        return apart, same, fitted.thetas, fitted.effects  # a kind and its records stay where they are

    explained = model.cost < SET.near * chance  # else most are as good as one that is not right, and say nothing
    possible = {e.id for e in kind.effects} - {effect, *rest}
    waiting = [name for name in dict.fromkeys((*tried, *strong, *_like(kind, [effect]))) if name in possible]
    rivals = dict[str, Rival]()
    while waiting:
        for name, (apart, alike, thetas, effects) in zip(waiting, each(rival, waiting), strict=True):
            rivals[name] = Rival(name, apart, alike, model.fitted(thetas, effects))
        likely = _like(kind, [name for name in waiting if rivals[name].alike]) if explained else []
        waiting = [name for name in likely if name in possible and name not in rivals]
    return list(rivals.values())


def _like(kind: Kind, names: Sequence[str]) -> list[str]:
    """The effects that look like one of `names`."""
    return [e.id for e in kind.effects if any(e.looks_like(kind.catalogue[name]) for name in names)]


def _imitation(
    kind: Kind, made: Sequence[Record], base: Theta, effects: Sequence[str], starts: Sequence[Mapping[str, float]]
) -> tuple[Theta, float]:
    """A fit of the last of `effects`, beside a `base` with the others, to a model's own predictions `made`, and the
    mean square of what it leaves, in units of the noise. Without noise and misfit an equal form fits exactly, however
    far off another search ended. For a table `made` are its records.
    """
    begun = prefixes(made[:1], kind.beginnings_s[-1]) if kind.beginnings_s else made
    effect = kind.declared(effects[-1])
    size, wanted = effect.amplitude(), effect.probe * np.outer((1, -1), 2.0 ** np.arange(SET.doublings))
    phase = effect.of_role("phase")
    turns = [{}] if phase is None else [{phase: float(at)} for at in np.arange(0, 2 * np.pi, np.pi / 4)]
    points = [
        base.with_(effect.id, {**start, size.name: float(value)})
        for start in (*starts, *({**effect.start(), **turn} for turn in turns))
        for value in np.unique([start[size.name], *wanted.ravel()])
        if size.lower <= value <= size.upper and value
    ]
    (start,) = Fitter.of(kind, begun, effects).lowest(points, 1)
    near = Fitter.of(kind, made, effects).near(start, SET.narrow, SET.rounds).theta
    return near, judged_cost(kind, made, near) if kind.beginnings_s else np.inf


def _compared(model: FittedModel, fitted: FittedModel, gain: float, chance: float) -> tuple[float, bool]:
    """By how many standard errors `model` leads, and whether the two are alike: the difference is chance, or so small
    that it may be an error of the form. The forms of the catalogue miss up to 0.3 % of the power of an effect of
    another form (docs/results/identification.md), and here at least what `model` itself leaves above `chance`.
    """
    training, on_training = model.training_blocks, fitted.training_blocks
    behind = float(np.log(fitted.cost / model.cost))
    apart = max(ahead(model.blocks, fitted.blocks), ahead(training, on_training))
    finer = max(SET.finer_gain, float(np.log1p(SET.rival_form * np.expm1(gain))))
    small = max(behind, float(np.log(on_training.sum() / training.sum()))) < finer
    within = fitted.cost - model.cost < model.cost - chance
    return apart, bool(within or (behind < SET.rival_gain * gain and (apart < SET.apart or small)))
