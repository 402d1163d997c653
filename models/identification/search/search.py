"""The search: calibrate, screen, compare, add while it gains, test again, compare rivals."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter

import numpy as np

from models.effects import effect_words
from models.identification.fitting.fit import Fit, judged_cost
from models.identification.fitting.fitter import Fitter
from models.identification.fitting.horizon import predictable, prefixes
from models.identification.intervals import Part
from models.identification.kind import Kind
from models.identification.search.candidates import Trial, compare_candidates, fair, shared_by, with_each
from models.identification.search.fitted_model import FittedModel
from models.identification.search.refinement import Known, refined, refined_at_last
from models.identification.search.rivals import Rival, rivals_of
from models.identification.search.screening import Screened, null_distribution, records_for_null, screen
from models.identification.settings import SET
from models.records.record import Record

Progress = Callable[[str, float], None]


@dataclass
class Search:
    """The result of a search. `gains` and `powers`: how far each effect lowered the validation cost when it was added,
    as a logarithm and as a difference. `doubts`: each effect with the model and a rival that the records do not
    separate. `ended` says why no further effect was sought (`why_ended`).
    """

    calibrated: Fit
    augmented: Fit
    effects: list[str] = field(default_factory=list)
    dropped: list[str] = field(default_factory=list)
    refinements: list[str] = field(default_factory=list)
    gains: dict[str, float] = field(default_factory=dict)
    powers: dict[str, float] = field(default_factory=dict)
    equivalent: dict[str, tuple[str, ...]] = field(default_factory=dict)
    doubts: list[tuple[str, FittedModel, Rival]] = field(default_factory=list)
    score: dict[str, float] = field(default_factory=dict)
    ended: str = "chance"
    rounds: list[tuple[int, list[Screened], list[Trial]]] = field(default_factory=list)
    threshold: float = 0.0
    timings: dict[str, float] = field(default_factory=dict)
    before: float = 0.0
    after: float = 0.0
    null_cost: float = 1.0
    sensitivity: float = 0.0
    horizon_s: float = np.inf
    known: Known = field(default_factory=dict)
    parts: list[Part] = field(default_factory=list)
    last_s: float = field(default_factory=time.monotonic)
    ends_s: float = np.inf

    def note(self, name: str) -> None:
        """The seconds since the last note were spent on `name`."""
        now = time.monotonic()
        self.timings[name] = self.timings.get(name, 0.0) + now - self.last_s
        self.last_s = now

    @property
    def model(self) -> list[str]:
        """Everything beyond the base: the named effects and the refinements of their shapes."""
        return [*self.effects, *self.refinements]


def search(
    kind: Kind,
    train: Sequence[Record],
    progress: Progress,
    rng: np.random.Generator,
    most: int = SET.most_effects,
    ends_s: float = np.inf,
) -> Search:
    """Calibrate on `train`, then add up to `most` effects, one at a time, while they gain, none after `ends_s`."""
    began = time.monotonic()
    progress("fitting the model without further effects", 0.02)
    records = kind.searched(train)
    splits = kind.splits(records)
    base = Fitter.of(kind, records, []).far([kind.nominal()])
    model = FittedModel(kind, splits).near([base.theta] * len(splits))
    found = Search(base, base, last_s=began, ends_s=ends_s)
    found.note("calibration")
    on_all = judged_cost(kind, records, base.theta)
    calibrated, model = model, _named(model, found, on_all, progress, rng, most)
    if kind.beginnings_s and not found.effects and found.after > SET.clean:
        trials = found.rounds[0][2] if found.rounds else []
        likeliest = (trials[0].fitted if trials else calibrated).thetas[0]
        found.horizon_s, _ = predictable(kind, splits[0][1], likeliest, SET.clean, rng)
        if found.horizon_s < np.inf:
            splits = [(prefixes(part, found.horizon_s), prefixes(held, found.horizon_s)) for part, held in splits]
            shorter = replace(calibrated, splits=splits).far([base.theta] for _ in splits)
            model = _named(shorter, found, on_all, progress, rng, most)
        elif any(t.model.training_cost < np.exp(-found.threshold) * calibrated.training_cost for t in trials):
            again = replace(calibrated, allowed=True).near(calibrated.thetas)
            fits = again.each(lambda t: again.near(t.fitted.thetas, t.fitted.effects), trials)
            trials = [replace(t, fitted=fit, before=again.blocks) for t, fit in zip(trials, fits, strict=True)]
            model = _named(again, found, on_all, progress, rng, most, trials)
    if found.effects:
        model, found.known = refined(model)
        found.refinements = [name for name in model.effects if name not in found.effects]
        found.after = model.cost
        found.note("finer shapes")
        model = _compare_rivals(model, found, progress)
        found.note("rivals")
    progress("fitting the found model to all records", 0.85)
    _finish(model, found, train)
    if found.effects and kind.beginnings_s:
        _, found.sensitivity = predictable(kind, splits[0][1], found.augmented.theta, np.inf, rng)
    found.note("final fit")
    return found


def _finish(model: FittedModel, found: Search, train: Sequence[Record]) -> None:
    """The fits of the base and of the model on all records `train`."""
    kind, rows, base, plain = model.kind, sum(map(len, train)), found.calibrated.theta, Fitter.of(model.kind, train, [])
    if kind.searched(train) != train:
        found.calibrated = plain.near(base)
    if found.effects:
        if kind.final != kind.free_run and not kind.beginnings_s:
            found.calibrated = plain.exactly(found.calibrated.theta)
        reached = SET.as_before * judged_cost(kind, model.part, model.thetas[0]) if found.refinements else 0.0
        fitter = Fitter.of(kind, train, found.model)
        fit = fitter.exactly(fitter.far([base | model.thetas[0]], max(SET.near, reached)).theta)
        added, found.augmented = refined_at_last(kind, train, found.effects, found.refinements, fit, found.known)
        found.refinements += added
        again = model.near([found.augmented.theta] * len(model.splits), found.model)
        if again.training_cost <= model.training_cost:  # of fits to the same parts, whichever search found it
            model, found.after = again, again.cost
    else:
        found.calibrated = found.augmented = plain.exactly(found.calibrated.theta)
    found.parts = [(sum(map(len, part)) / rows, theta) for part, theta in model.parts]


def _named(
    model: FittedModel,
    found: Search,
    on_all: float,
    progress: Progress,
    rng: np.random.Generator,
    most: int,
    known: Sequence[Trial] = (),
) -> FittedModel:
    """Effects added to `found` one at a time while validation records gain beyond what the null distribution gives;
    `model`, the calibrated base, with them. `found.ended` says why no more were sought. None is where the base fitted
    to all records costs no more than chance `on_all` of them, whatever fits to a part cost elsewhere: a slip event that
    these miss is no effect. The first round compares the trials that are `known`, if any.
    """
    kind = model.kind
    progress("simulating what noise alone would show", 0.15)
    records = records_for_null(kind, model.part)
    found.threshold, found.null_cost = null_distribution(kind, records, model.thetas[0], rng)
    found.threshold = max(found.threshold, kind.least_gain)
    found.note("null distribution")
    found.before = found.after = min(model.cost, on_all)
    found.rounds = []
    while True:
        number = len(found.rounds) + 1
        found.ended = why_ended(kind, found, most)
        if found.ended:
            return model

        def moved(name: str, share: float, number: int = number) -> None:
            told = f"trying each effect with the model, round {number}: {effect_words(name)}"
            progress(told, 0.05 + 0.15 * (number + share))

        progress(f"looking for effects in the residual, round {number}", 0.05 + 0.15 * number)
        screened = screen(kind, model.part, [*model.effects], model.thetas[0], found.dropped)
        found.note("screening")
        trials = [*known] if number == 1 and known else compare_candidates(model, screened, moved)
        trials, model = fair(model, trials)
        found.after = model.cost
        if not found.effects:
            found.before = found.after
        found.rounds.append((number, screened, trials))
        found.note("fitting candidates")
        best = next((t for t in trials if np.mean(t.before - t.blocks) > SET.least_drop), None)
        if best is None or best.gain <= _wanted(kind, found, best):
            found.ended = "form" if best and best.gain > found.threshold else "gain"
            return model
        found.effects.append(best.effect)
        found.gains[best.effect] = best.gain
        found.powers[best.effect] = found.after - best.blocks.mean()
        model = best.model.far([theta] for theta in best.model.thetas)
        found.after = min(float(best.blocks.mean()), model.cost)
        model = _test_again(model, found)
        found.note("testing again")


def why_ended(kind: Kind, found: Search, most: int) -> str:
    """Why no further effect is sought: what is left is chance, there are enough effects, or the time is over; "" where
    one is. Then no candidate gains ("gain"), or none gains more than the error of the found forms may be ("form").
    """
    if found.after < limit_of_chance(kind, found):
        return "chance"
    if len(found.effects) >= most:
        return "most"
    return "time" if time.monotonic() > found.ends_s else ""


def limit_of_chance(kind: Kind, found: Search) -> float:
    """The validation cost below which nothing is named: too near to what records without a missing effect leave."""
    return float(max(found.null_cost + SET.least_drop, found.null_cost * np.exp(kind.least_gain)))


def _wanted(kind: Kind, found: Search, trial: Trial) -> float:
    """What a `trial` has to gain: more than chance; and more than the error of the found forms may be, unless they
    leave more than any known form does, and it explains all of that. Nothing is enough for one that looks like a found
    curve over the speed where the error of that curve's form may be all that is left.
    """
    effect, above = kind.declared(trial.effect), found.after - found.null_cost
    curves = [kind.declared(name) for name in found.effects if kind.declared(name).by_speed]
    if above < SET.rival_form * sum(found.powers[one.id] for one in curves if one.looks_like(effect)):
        return np.inf
    first = next((gain for name, gain in found.gains.items() if not kind.declared(name).exact), 0.0)
    return _enough(kind, found, found.after, float(trial.blocks.mean()), first)


def _enough(kind: Kind, found: Search, before: float, after: float, gain: float) -> float:
    """The same beside effects that gain so much, for what takes the cost from `before` to `after`."""
    left = before - found.null_cost > SET.rival_form * (found.before - found.null_cost)
    whole = left and after < limit_of_chance(kind, found)
    return found.threshold if whole else max(found.threshold, kind.next_share * gain)


def _test_again(model: FittedModel, found: Search) -> FittedModel:
    """Drops every earlier effect without which the validation gain falls by no more than chance, or than is wanted."""
    for effect in found.effects[:-1]:
        rest = [name for name in found.effects if name != effect]
        beside = list(dict.fromkeys(curve for name in rest for curve in shared_by(model.kind, name)))
        shapes = ([], beside) if beside else ([],)
        starts = [[with_each(theta.without(effect), shape) for theta in model.thetas] for shape in shapes]
        fits = [model.far(some, [*rest, *shape], seeds=1) for some, shape in zip(starts, shapes, strict=True)]
        best = min(fits, key=attrgetter("cost"))
        known = sum(found.gains[name] for name in rest if model.kind.declared(name).exact)
        rest_alone = max(float(np.log(found.before / best.cost)) - known, 0.0)
        if np.log(best.cost / found.after) < _enough(model.kind, found, best.cost, found.after, rest_alone):
            found.effects.remove(effect)
            found.dropped.append(effect)
            found.after, model = best.cost, best
    return model


def _compare_rivals(model: FittedModel, found: Search, progress: Progress) -> FittedModel:
    """The rivals and score of each effect of `found`; one that leads clearly takes its place, and its turn."""
    left = [*found.effects]
    for _ in range(2 * len(left)):
        if not left:
            break
        effect = left.pop(0)
        progress(f"trying what else could explain it: {effect_words(effect)}", 0.82)
        row = next((row for row in found.rounds if row[2] and row[2][0].effect == effect), found.rounds[0])
        rivals = rivals_of(model, effect, found.gains[effect], row[1], row[2], found.null_cost)
        ahead = min(rivals, key=lambda rival: rival.apart, default=None)
        if ahead and ahead.apart < -SET.apart and not ahead.alike:
            model = _replaced(model, found, effect, ahead)
            left.append(ahead.effect)
            continue
        alike = sorted((rival for rival in rivals if rival.alike), key=lambda rival: rival.apart)
        names = (*(rival.effect for rival in alike), *model.kind.equivalents.get(effect, ()))
        found.equivalent[effect] = tuple(name for name in dict.fromkeys(names) if name not in found.effects)
        found.doubts += [(effect, model, rival) for rival in alike if rival.effect not in found.effects]
        nearest = min((rival.apart for rival in rivals if not rival.alike), default=SET.never)
        found.score[effect] = float(1 - 0.5 * np.exp(-0.5 * max(nearest, 0.0) ** 2))
    for effect in found.effects:  # one that replaced others in the last turn
        found.equivalent.setdefault(effect, ())
        found.score.setdefault(effect, 0.5)
    return model


def _replaced(model: FittedModel, found: Search, effect: str, rival: Rival) -> FittedModel:
    """`found` and the model with the `rival` in the place of the `effect`."""
    found.effects[found.effects.index(effect)] = rival.effect
    found.gains = {rival.effect if name == effect else name: gain for name, gain in found.gains.items()}
    found.gains[rival.effect] += float(np.log(model.cost / rival.fitted.cost))
    found.refinements = [name for name in rival.fitted.effects if name not in found.effects]
    found.after = rival.fitted.cost
    return rival.fitted
