"""Fits on ever longer beginnings from many places: over many slip events a wrong base is out of step for good."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from models.checks.usable import lead_in_s
from models.identification.fitting.fit import Fit, FreeParameter, Problem, axes, costs_of
from models.identification.kind import Kind, Split
from models.identification.search.fitted_model import judged_cost
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


@dataclass(frozen=True)
class Effort:
    """Places to look at, how many to go down from at each length (whole records last), rounds at the first lengths."""

    places: int
    kept: tuple[int, ...]
    rounds: int


THOROUGH = Effort(512, (16, 6, 3, 2, 1), SET.rounds)
QUICK = Effort(128, (3, 2, 2, 1, 1), 3)
FROM_CLOSE = Effort(64, (2, 2, 1, 1, 1), 3)


def base_known(kind: Kind) -> bool:
    """Whether a prior holds the base so well that it cannot be a slip event beside the right one."""
    fitted = [p for p in kind.base if p.fit and not p.effect]
    return bool(fitted) and all(SET.near_start * p.spread <= SET.settled * abs(p.value) for p in fitted)


@dataclass
class GrowingHorizon:
    """One model on its way from the first slip events to whole records. At every length the starts, and the effects
    drawn anew on the bases found so far, stand beside what the shorter ones led to, for what a short one does not show
    it cannot tell; the best fit so far goes on whatever it costs at first. Of the effect `fresh` not even the size is
    known; another `seed` draws other places. `fits` are those of the last length, the best first.
    """

    kind: Kind
    effects: Sequence[str]
    starts: Sequence[Theta]
    effort: Effort
    fresh: str = ""
    seed: int = 0
    fits: list[Fit] = field(default_factory=list)

    def on(self, number: int, length: float, records: Sequence[Record]) -> None:
        """To the next `length` in s, `records` being the beginnings number `number`."""
        places = list(self.starts)
        if self.fits:
            found = [fit.theta for fit in self.fits]
            points = found + places + self._redrawn(found[: SET.bases])
        else:
            points = places + self._scattered()
        costs = costs_of(self.kind, records, points, self.kind.free_run)
        kept = self.effort.kept[number]
        best = [points[i] for i in np.argsort(costs, kind="stable")[:kept]]
        if self.fits and kept > 1 and points[0] not in best:
            best[-1] = points[0]
        widths, rounds = (SET.narrow, SET.rounds) if number >= SET.telling else (SET.narrow[-1:], self.effort.rounds)
        problem = Problem.of(self.kind, records, self.effects)
        fits = [problem.narrowing(point, widths, rounds) for point in best]
        self.fits = sorted(fits, key=lambda fit: fit.cost)

    def over(self, records: Sequence[Record]) -> Fit:
        """The best fit on the whole `records`."""
        for number, length, parts in _lengths(self.kind, records):
            self.on(number, length, parts)
        return self.fits[0]

    def _scattered(self) -> list[Theta]:
        """Places around the nominal base and the starts' effects, the fresh one's amplitude of every size."""
        return self._drawn(self.starts, axes(self.kind, self.effects), self.effort.places, self.seed)

    def _redrawn(self, found: Sequence[Theta]) -> list[Theta]:
        """Each base of `found` with effects from around their declared values: a drift does not show at first."""
        moved = [axis for axis in axes(self.kind, self.effects) if axis.parameter.effect in self.effects]
        bases = [theta.only(self.kind.in_base) for theta in found]
        return self._drawn(bases, moved, self.effort.places // 2, self.seed + 1)

    def _drawn(self, starts: Sequence[Theta], moved: Sequence[FreeParameter], count: int, seed: int) -> list[Theta]:
        shares = scipy.stats.qmc.Sobol(len(moved), seed=seed).random(count) if moved else np.zeros((0, 0))
        return [
            start
            | {
                axis.name: _place(self.kind, axis, start, share, self.fresh)
                for axis, share in zip(moved, row, strict=True)
            }
            for start, row in ((starts[i % len(starts)], row) for i, row in enumerate(shares))
        ]


def eliminate(
    records: Sequence[Record],
    climbs: Mapping[str, GrowingHorizon],
    counting: int,
    behind: float,
    moved: Callable[[str, float], None] = lambda name, share: None,
) -> dict[str, Fit]:
    """Fits on the whole records of those `climbs` that stay in reach of the first `counting`, or are declared
    confounded effects of the first one, and leave at most `behind` times what the first one does, or no more than
    chance: a beginning has few numbers, and one with many parameters leaves less of them. The rest end on their way,
    none of them on the shortest beginning. `moved` hears of each climb that goes on, and the share of the work
    that is done.
    """
    running, kind = dict(climbs), next(iter(climbs.values())).kind
    for number, length, parts in _lengths(kind, records):
        for k, (name, climb) in enumerate(running.items()):
            moved(name, (number + k / len(running)) / (len(kind.beginnings_s) + 1))
            climb.on(number, length, parts)
        costs = {name: climb.fits[0].chi2 for name, climb in running.items()}
        if not number:
            continue
        ranked = sorted(costs.values())
        within = SET.in_reach if number >= SET.telling else SET.early_reach
        reach, limit = within * ranked[min(counting, len(costs)) - 1], behind * ranked[0]
        alike = kind.catalogue[min(costs, key=lambda name: costs[name])].confounders
        running = {
            name: climb
            for name, climb in running.items()
            if (costs[name] <= limit and (costs[name] <= reach or name in alike)) or _by_chance(climb.fits[0])
        }
    return {name: climb.fits[0] for name, climb in running.items()}


def _by_chance(fit: Fit) -> bool:
    """Whether noise alone may leave what `fit` does."""
    return bool(fit.cost <= scipy.stats.chi2.ppf(SET.right_leaves, fit.count))


def _lengths(kind: Kind, records: Sequence[Record]) -> Iterator[tuple[int, float, list[Record]]]:
    """Number, length in s and records cut to it, the whole ones last."""
    for number, length in enumerate((*kind.beginnings_s, np.inf)):
        parts = prefixes(records, length)
        if length == np.inf or any(len(part) < len(record) for part, record in zip(parts, records, strict=True)):
            yield number, length, parts


def prefixes(records: Sequence[Record], length: float) -> list[Record]:
    """The first `length` s of each record that count, and what is run through before."""
    return [record.beginning(length + lead_in_s(record)) for record in records]


def _place(kind: Kind, axis: FreeParameter, start: Theta, share: float, fresh: str) -> float:
    """The value of one parameter for a number `share` between 0 and 1."""
    p = axis.parameter
    if not p.effect:
        value = p.value + min(SET.base_off * abs(p.value), SET.near_start * p.spread) * (2 * share - 1)
    elif p.effect == fresh and p.name == kind.catalogue[fresh].amplitude().name:
        sign, size = np.sign(share - 0.5) or 1.0, abs(2 * share - 1)
        value = sign * kind.catalogue[fresh].probe * 2 ** (SET.doublings * size)
        value = value if p.lower <= value <= p.upper else -value
    else:
        value = start.get(axis.name, p.value)
        reach = min(p.spread, max(SET.near_start * axis.scale, SET.near_start / 10 * abs(value)))
        value += reach * (2 * share - 1)
    return float(np.clip(value, p.lower, p.upper))


def sensitivity_cost(kind: Kind, splits: Sequence[Split], theta: Theta, rng: np.random.Generator) -> float:
    """Validation cost that the model leaves of itself, the base's numbers 0.1 % off: no fit can do better."""
    return max(judged_cost(kind, records, theta) for records in _off(kind, splits[0][1], theta, rng))


def predictable(
    kind: Kind, splits: Sequence[Split], theta: Theta, most: float, rng: np.random.Generator
) -> tuple[float, list[Split]]:
    """The longest beginnings of the records, in s (inf: whole ones), over which the model leaves less than `most` of
    itself, and the splits cut to them: where one slip event that comes a little early moves all that follow, free runs
    soon tell nothing.
    """
    imitated = _off(kind, splits[0][1], theta, rng)
    for length in (np.inf, *reversed(kind.beginnings_s[1:])):  # the first holds too few slip events to judge by
        if max(judged_cost(kind, prefixes(records, length), theta) for records in imitated) < most:
            break
    return length, [(prefixes(part, length), prefixes(rest, length)) for part, rest in splits]


def _off(kind: Kind, held: Sequence[Record], theta: Theta, rng: np.random.Generator) -> list[list[Record]]:
    """Imitations of the records `held` on the model with each base number 0.1 % up or down."""
    fitted = {p.key for p in kind.base if p.fit}
    moved = (
        theta | {name: theta[name] * (1 + SET.thousandth * rng.choice((-1, 1))) for name in theta if name in fitted}
        for _ in range(SET.self_imitations)
    )
    return [[kind.imitate(record, point, rng) for record in held] for point in moved]
