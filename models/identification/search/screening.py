"""Screening without refitting: how much each candidate would explain of the residual of the base."""

from __future__ import annotations

import itertools
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter

import numpy as np

from models.effects.effect import Effect
from models.identification.fitting.fit import evaluate_all, judged_cost
from models.identification.fitting.fitter import Fitter
from models.identification.fitting.horizon import prefixes
from models.identification.kind import Array, Kind
from models.identification.settings import SET
from models.records.record import Record
from models.rigs.columns import TIME
from models.theta import Theta
from models.words.quantities import measured_unit
from models.words.sentences import Quantity
from models.workers import each


@dataclass(frozen=True)
class Screened:
    """One candidate: the share of the residual that it explains at first order, and the starts of joint fits, one a
    view of the residual, that of its best shape first.
    """

    effect: str
    share: float
    starts: tuple[dict[str, float], ...]


@dataclass(frozen=True)
class _View:
    """The residual of a fit as `seen`, each sample or what is slow: `here`, and without the fitted `basis`."""

    seen: Callable[[Array], Array]
    here: Array
    residual: Array
    basis: Array

    @classmethod
    def of(cls, seen: Callable[[Array], Array], residual: Array, changes: Array) -> _View:
        own = seen(residual[None])
        basis = np.linalg.qr((seen(residual + changes) - own).T)[0]
        return cls(seen, own, own[0] - basis @ (basis.T @ own[0]), basis)

    def measured(self, effect: type[Effect], start: Mapping[str, float], change: Array) -> Screened:
        """What the residual's changes (1 or 2, m) along the amplitude, and its quadrature, explain of it."""
        amplitude, phase = effect.amplitude(), effect.of_role("phase")
        D, r = change.T, self.residual
        D = D - self.basis @ (self.basis.T @ D)
        size, power, own = float(np.linalg.norm(D)), float(r @ r), dict(start)
        if not (0 < power < np.inf) or not np.isfinite(size) or size < SET.inside * np.sqrt(power):
            return Screened(effect.id, 0.0, (own,))
        factor, *_ = np.linalg.lstsq(D, -r, rcond=None)
        if phase is not None:
            own[phase] = float(np.arctan2(factor[1], factor[0]))
        scale = float(np.hypot(*factor)) if len(factor) == 2 else float(factor[0])
        wanted, room = own[amplitude.name] * scale, SET.well_inside
        own[amplitude.name] = room * float(np.clip(wanted / room, amplitude.lower, amplitude.upper))
        within = max(own[amplitude.name] / wanted, 0.0) if wanted else 0.0
        share = 1 - float(np.sum((r + within * (D @ factor)) ** 2)) / power
        return Screened(effect.id, share, (own,))


def screen(
    kind: Kind, records: Sequence[Record], effects: Sequence[str], theta: Theta, dropped: Sequence[str] = ()
) -> list[Screened]:
    """Every candidate's share of the residual of a fit with `effects` at `theta`, best first: the larger of what it
    shows of each sample and of what is slow, in its best shape, with the starts of the best few shapes at each view.
    """
    fitter, taken = Fitter.of(kind, records, effects), {*effects, *dropped}
    x, share = fitter.at(theta), attrgetter("share")
    n, steps = len(x), SET.screened_secant * np.diag([axis.scale for axis in fitter.axes])
    around = fitter.residuals([fitter.at(fitter.theta(point)) for point in (x, *(x + steps), *(x - steps))])
    here, changes = around[0], (around[1 : n + 1] - around[n + 1 :]) / 2
    seen = (np.asarray, partial(kind.slow, records)) if kind.beginnings_s else (np.asarray,)
    views = [_View.of(one, here, changes) for one in seen]

    def tried(effect: type[Effect]) -> Screened:
        amplitude, phase = effect.amplitude(), effect.of_role("phase")
        size = {amplitude.name: float(np.clip(effect.probe, amplitude.lower, amplitude.upper))}
        starts = [{**effect.start(), **shape, **size} for shape in _shapes(effect, records)]
        phases: tuple[dict[str, float], ...] = ({},) if phase is None else ({phase: 0.0}, {phase: np.pi / 2})
        n, shown = len(phases), [list[Screened]() for _ in views]
        some = max(1, kind.lanes // n)
        for k in range(0, len(starts), some):
            thetas = [theta.with_(effect.id, {**start, **at}) for start in starts[k : k + some] for at in phases]
            rows = np.tile(here, (len(thetas), 1))  # the priors' rows do not change
            own = evaluate_all(kind, records, thetas, fitter.criterion)
            rows[:, : own.shape[1]] = own
            for view, found in zip(views, shown, strict=True):
                change = view.seen(rows) - view.here
                found += [
                    view.measured(effect, s, change[n * i : n * i + n]) for i, s in enumerate(starts[k : k + some])
                ]
        best = [sorted(own, key=share, reverse=True)[: SET.screened_starts] for own in shown]
        leader = max((rows[0] for rows in best), key=share)
        return replace(leader, starts=tuple(start for rows in best for row in rows for start in row.starts))

    rows = each(tried, [effect for effect in kind.effects if effect.id not in taken])
    return sorted(rows, key=share, reverse=True)


def _shapes(effect: type[Effect], records: Sequence[Record]) -> list[dict[str, float]]:
    grid = {key: list(values) for key, values in effect.grid.items() if key != effect.of_role("phase")}
    position = effect.of_role("place")
    if position is not None:
        x = np.concatenate([record["position_m"] for record in records])
        low, high = np.percentile(x, SET.within)
        grid[position] = np.linspace(low, high, SET.positions).tolist()
    return [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())]


def records_for_null(kind: Kind, part: Sequence[Record]) -> Sequence[Record]:
    """What of `part` is imitated: the first few seconds of time series that are fitted on prefixes, else all."""
    if not kind.beginnings_s:
        return part
    ends = np.cumsum([np.ptp(record[TIME]) for record in part])
    return prefixes(part[: 1 + int(np.searchsorted(ends, SET.imitated_s))], SET.imitated_s)


def null_distribution(
    kind: Kind, records: Sequence[Record], theta: Theta, rng: np.random.Generator
) -> tuple[float, float]:
    """The null distribution, from imitated records without an effect: the largest gain -ln(1 - share) over all
    candidates, and the mean square of the residuals.
    """
    gain, cost = 0.0, 0.0
    for _ in range(SET.imitations):
        imitated, own, left = _imitated(kind, records, theta, rng)
        cost = max(cost, left)
        rows = screen(kind, imitated, [], own)
        gain = max(gain, *(-float(np.log1p(-min(row.share, SET.share_most))) for row in rows)) if rows else gain
    return gain, cost


def _imitated(
    kind: Kind, records: Sequence[Record], theta: Theta, rng: np.random.Generator
) -> tuple[list[Record], Theta, float]:
    """The `records` as the model at `theta` makes them, what explains them, and the cost of that: where a slip event of
    an imitation depends on the step of the computation, the base is refitted to it, as it was to the records.
    """
    imitated = [kind.imitate(record, theta, rng) for record in records]
    found = [(theta, judged_cost(kind, imitated, theta))]
    if found[0][1] > SET.near:
        again = Fitter.of(kind, imitated, []).near(theta, SET.fine).theta
        found.append((again, judged_cost(kind, imitated, again)))
    return (imitated, *min(found, key=lambda fit: fit[1]))


def least_sizes(kind: Kind, records: Sequence[Record], theta: Theta, gain: float, cost: float) -> dict[str, float]:
    """The smallest amplitude of each effect of `kind`, in a middle shape, for which a search would look in such
    `records` (their first 20 s) with the base at `theta`: the base, refitted, leaves then more than chance, `cost` and
    `gain`, as a search asks for. None for one that none of the amplitudes that a search starts from shows.
    """
    some = prefixes(records, SET.plan_shortest_s) if kind.beginnings_s else records
    made, theta, least = _imitated(kind, some, theta, np.random.default_rng(0))
    wanted = max(cost + SET.least_drop, cost * float(np.exp(max(gain, kind.least_gain)))) - least

    def more(effect: type[Effect], size: float) -> float:
        """What a model with the effect leaves of records without it: as much as one without it of records with it."""
        shapes, fitter = _shapes(effect, made), replace(Fitter.of(kind, made, []), effects=(effect.id,))
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
