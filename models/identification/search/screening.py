"""Screening without refitting: how much each candidate would explain of the residual of the base."""

from __future__ import annotations

import itertools
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
        starts = [{**effect.start(), **shape, **size} for shape in shapes_of(effect, records)]
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


def shapes_of(effect: type[Effect], records: Sequence[Record]) -> list[dict[str, float]]:
    """The shapes on the grid of `effect`, its places among those of the `records`."""
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
        imitated, own, left = imitated_by(kind, records, theta, rng)
        cost = max(cost, left)
        rows = screen(kind, imitated, [], own)
        gain = max(gain, *(-float(np.log1p(-min(row.share, SET.share_most))) for row in rows)) if rows else gain
    return gain, cost


def imitated_by(
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
