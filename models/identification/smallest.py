"""What records would show before any search in them: the smallest amplitude of each effect that is told from chance."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from models.effects.effect import Effect
from models.identification.fitting.fit import judged_cost
from models.identification.fitting.fitter import Fitter
from models.identification.fitting.horizon import prefixes
from models.identification.kind import Kind
from models.identification.search.screening import imitated_by, null_distribution, records_for_null, shapes_of
from models.identification.search.search import Search
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta
from models.words.quantities import measured_unit
from models.words.sentences import Quantity
from models.workers import each


def least_sizes(kind: Kind, records: Sequence[Record], theta: Theta, gain: float, cost: float) -> dict[str, float]:
    """The smallest amplitude of each effect of `kind`, in a middle shape, for which a search would look in such
    `records` (their first 20 s) with the base at `theta`: the base, refitted, leaves then more than chance, `cost` and
    `gain`, as a search asks for. None for one that none of the amplitudes that a search starts from shows.
    """
    some = prefixes(records, SET.plan_shortest_s) if kind.beginnings_s else records
    made, theta, least = imitated_by(kind, some, theta, np.random.default_rng(0))
    wanted = max(cost + SET.least_drop, cost * float(np.exp(max(gain, kind.least_gain)))) - least

    def more(effect: type[Effect], size: float) -> float:
        """What a model with the effect leaves of records without it: as much as one without it of records with it."""
        shapes, fitter = shapes_of(effect, made), replace(Fitter.of(kind, made, []), effects=(effect.id,))
        start = {**effect.start(), **shapes[len(shapes) // 2], effect.amplitude().name: size}
        fit = fitter.near(theta.with_(effect.id, start), SET.narrow, SET.its_rounds)
        return judged_cost(kind, made, fit.theta) - least

    def sized(effect: type[Effect]) -> float:
        p, known = effect.amplitude(), dict[float, float]()
        doubled = np.clip(effect.probe * 2.0 ** np.arange(SET.doublings + 1), p.lower, p.upper)
        sizes = sorted(set(doubled.tolist()), key=abs)
        at = bisect_left(sizes, wanted, key=lambda size: known.setdefault(size, more(effect, size)))
        if at == len(sizes):
            return np.inf
        below = abs(sizes[at - 1]) if at else 0.0  # what is left grows about with the square
        return float(max(below, abs(sizes[at]) * np.sqrt(wanted / known[sizes[at]])))

    found = zip(kind.effects, each(sized, kind.effects), strict=True)
    return {effect.id: size for effect, size in found if size < np.inf}


def not_missed(kind: Kind, sizes: Mapping[str, float], found: Search) -> dict[str, float]:
    """`sizes`, none below that of a candidate's fit which gained beyond chance, but less than what names it: where slip
    events move, what a base leaves that is refitted from close by is more than what a search leaves.
    """
    larger = dict(sizes)
    for trial in (trial for *_, trials in found.rounds for trial in trials):
        if trial.effect in sizes and SET.doubted * found.threshold < trial.gain <= found.threshold:
            fitted = trial.fitted.thetas[0][trial.effect, kind.declared(trial.effect).amplitude().name]
            larger[trial.effect] = max(larger[trial.effect], abs(fitted))
    return larger


def unshown(kind: Kind, sizes: Mapping[str, float]) -> list[type[Effect]]:
    """The effects of which the least of `sizes` that records would show is above the middle of those that a search
    starts from, as it doubles them.
    """
    middle = 2 ** (SET.doublings / 2)
    return [effect for effect in kind.effects if sizes.get(effect.id, np.inf) > abs(effect.probe) * middle]


def smallest(kind: Kind, records: Sequence[Record]) -> dict[str, Quantity]:
    """The smallest amplitude of each effect of `kind` that a search in such `records` would tell from chance, before
    any fit: in records that the nominal model makes. Nothing where they are too few for that.
    """
    searched, theta = kind.searched(records), kind.nominal()
    chance = null_distribution(kind, records_for_null(kind, searched), theta, np.random.default_rng(0))
    sizes = least_sizes(kind, searched, theta, *chance)
    units = {name: kind.declared(name).amplitude().unit for name in sizes}
    return {name: Quantity(size, measured_unit(units[name], kind.unit)) for name, size in sorted(sizes.items())}
