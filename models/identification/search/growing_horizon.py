"""Fits on growing prefixes from many starts: over many slip events a wrong base loses step for good."""

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
    """Starts to evaluate, how many to descend from at each length (whole records last), rounds at the first lengths."""

    starts: int
    kept: tuple[int, ...]
    rounds: int


THOROUGH = Effort(512, (16, 6, 3, 2, 1), SET.rounds)
QUICK = Effort(128, (3, 2, 2, 1, 1), 3)
FROM_CLOSE = Effort(64, (2, 2, 1, 1, 1), 3)


def base_known(kind: Kind) -> bool:
    """Whether priors are so narrow that the base cannot be off by a slip event."""
    fitted = [p for p in kind.base if p.fit and not p.effect]
    return bool(fitted) and all(SET.near_start * p.spread <= SET.settled * abs(p.value) for p in fitted)


@dataclass
class GrowingHorizon:
    """One model fitted on growing prefixes, from the first slip events to whole records. Every length is started from
    the fits of the length before, from the `starts` again, and from effects redrawn on the bases found so far, because
    a short prefix cannot show every effect. The best fit so far is always kept. Of the effect `fresh` not even the size
    is known; another `seed` draws other starts. `fits` are those of the last length, the best first.
    """

    kind: Kind
    effects: Sequence[str]
    starts: Sequence[Theta]
    effort: Effort
    fresh: str = ""
    seed: int = 0
    fits: list[Fit] = field(default_factory=list)

    def on(self, number: int, length: float, records: Sequence[Record]) -> None:
        """To the next `length` in s, `records` being the prefixes number `number`."""
        starts = list(self.starts)
        if self.fits:
            found = [fit.theta for fit in self.fits]
            points = found + starts + self._redrawn(found[: SET.bases])
        else:
            points = starts + self._scattered()
        costs = costs_of(self.kind, records, points, self.kind.free_run)
        kept = self.effort.kept[number]
        best = [points[i] for i in np.argsort(costs, kind="stable")[:kept]]
        if self.fits and kept > 1 and points[0] not in best:
            best[-1] = points[0]
        widths, rounds = (
            (SET.narrow, SET.rounds) if number >= SET.ranked_from else (SET.narrow[-1:], self.effort.rounds)
        )
        problem = Problem.of(self.kind, records, self.effects)
        fits = [problem.narrowing(point, widths, rounds) for point in best]
        self.fits = sorted(fits, key=lambda fit: fit.cost)

    def over(self, records: Sequence[Record]) -> Fit:
        """The best fit on the whole `records`."""
        for number, length, parts in _lengths(self.kind, records):
            self.on(number, length, parts)
        return self.fits[0]

    def _scattered(self) -> list[Theta]:
        """Points around the nominal base and the starts' effects, with every size of the fresh one."""
        return self._drawn(self.starts, axes(self.kind, self.effects), self.effort.starts, self.seed)

    def _redrawn(self, found: Sequence[Theta]) -> list[Theta]:
        """Each base of `found` with effects drawn around their declared values: a drift does not show at first."""
        moved = [axis for axis in axes(self.kind, self.effects) if axis.parameter.effect in self.effects]
        bases = [theta.only(self.kind.in_base) for theta in found]
        return self._drawn(bases, moved, self.effort.starts // 2, self.seed + 1)

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
    horizons: Mapping[str, GrowingHorizon],
    counting: int,
    behind: float,
    moved: Callable[[str, float], None] = lambda name, share: None,
) -> dict[str, Fit]:
    """Fits on the whole records of those `horizons` that are not eliminated. One stays while its cost is close to that
    of the best `counting`, or is that of a declared confounder of the best, and at most `behind` times the best; or
    while its cost is chance, because a model with many parameters leaves less of a short prefix. None is eliminated on
    the shortest prefix. `moved` is called with each candidate and the share of the work that is done.
    """
    running, kind = dict(horizons), next(iter(horizons.values())).kind
    for number, length, parts in _lengths(kind, records):
        for k, (name, horizon) in enumerate(running.items()):
            moved(name, (number + k / len(running)) / (len(kind.beginnings_s) + 1))
            horizon.on(number, length, parts)
        costs = {name: horizon.fits[0].chi2 for name, horizon in running.items()}
        if not number:
            continue
        ranked = sorted(costs.values())
        within = SET.in_reach if number >= SET.ranked_from else SET.early_reach
        reach, limit = within * ranked[min(counting, len(costs)) - 1], behind * ranked[0]
        alike = kind.catalogue[min(costs, key=lambda name: costs[name])].confounders
        running = {
            name: horizon
            for name, horizon in running.items()
            if (costs[name] <= limit and (costs[name] <= reach or name in alike)) or _by_chance(horizon.fits[0])
        }
    return {name: horizon.fits[0] for name, horizon in running.items()}


def _by_chance(fit: Fit) -> bool:
    """Whether noise alone may cause the cost of `fit`."""
    return bool(fit.cost <= scipy.stats.chi2.ppf(SET.right_leaves, fit.count))


def _lengths(kind: Kind, records: Sequence[Record]) -> Iterator[tuple[int, float, list[Record]]]:
    """Number, length in s and records cut to it, the whole ones last."""
    for number, length in enumerate((*kind.beginnings_s, np.inf)):
        parts = prefixes(records, length)
        if length == np.inf or any(len(part) < len(record) for part, record in zip(parts, records, strict=True)):
            yield number, length, parts


def prefixes(records: Sequence[Record], length: float) -> list[Record]:
    """The first `length` s of each record that count, and the rows before."""
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
    """Validation cost of the model against itself with the base 0.1 % off: no fit can do better."""
    return max(judged_cost(kind, records, theta) for records in _off(kind, splits[0][1], theta, rng))


def predictable(
    kind: Kind, splits: Sequence[Split], theta: Theta, most: float, rng: np.random.Generator
) -> tuple[float, list[Split]]:
    """The longest prefixes of the records in s (inf: whole records) over which the model predicts itself with a cost
    below `most`, and the splits cut to them: where one early slip event shifts all that follow, longer free runs carry
    no information.
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
