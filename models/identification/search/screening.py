"""Screening without refitting: how much each candidate would explain of the residual of the base."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

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
    """One candidate: the share of the residual that it explains at first order, the starts of joint fits (one a view of
    the residual), and the smallest amplitude that is detectable at a share of 1.
    """

    effect: str
    share: float
    starts: tuple[dict[str, float], ...]
    sensitivity: float


@dataclass(frozen=True)
class _View:
    """The residual of a fit at `theta` with the fitted directions, `basis`, taken out."""

    fitter: Fitter
    theta: Theta
    residual: Array
    basis: Array

    @classmethod
    def at(cls, fitter: Fitter, theta: Theta) -> _View:
        x = fitter.at(theta)
        jacobian = fitter.jacobian(x, SET.screened_secant)
        basis = np.linalg.qr(jacobian)[0] if jacobian.shape[1] else np.zeros((jacobian.shape[0], 0))
        return cls(fitter, theta, fitter.residuals([x])[0], basis)

    def cleared(self, vectors: Array) -> Array:
        return np.asarray(vectors - self.basis @ (self.basis.T @ vectors))

    def best(self, taken: Sequence[str] = ()) -> list[Screened]:
        """Each candidate not `taken` in its best shape, with the starts of the best few shapes; best first."""

        def tried(effect: type[Effect]) -> Screened:
            shapes = sorted(self.explained(effect, list(_shapes(effect, self.fitter.records))), key=_by_share)
            starts = (start for row in shapes[: SET.screened_starts] for start in row.starts)
            return replace(shapes[0], starts=tuple(starts))

        wanted = [effect for effect in self.fitter.kind.effects if effect.id not in taken]
        return sorted(each(tried, wanted), key=_by_share)

    def explained(self, effect: type[Effect], shapes: Sequence[Mapping[str, float]]) -> list[Screened]:
        """`effect` in each of `shapes`, all evaluated together."""
        amplitude, phase = effect.amplitude(), effect.of_role("phase")
        size = {amplitude.name: float(np.clip(effect.probe, amplitude.lower, amplitude.upper))}
        starts = [{**effect.start(), **shape, **size} for shape in shapes]
        phases: tuple[dict[str, float], ...] = ({},) if phase is None else ({phase: 0.0}, {phase: np.pi / 2})
        thetas = [self.theta.with_(effect.id, {**start, **at}) for start in starts for at in phases]
        kind, n = self.fitter.kind, len(phases)
        shown = []
        step = n * max(1, kind.lanes // n)
        for first in range(0, len(thetas), step):
            seen = evaluate_all(kind, self.fitter.records, thetas[first : first + step], self.fitter.criterion)
            own = starts[first // n : (first + step) // n]
            shown += [self._measured(effect, start, seen[n * k : n * (k + 1)]) for k, start in enumerate(own)]
        return shown

    def _measured(self, effect: type[Effect], start: dict[str, float], seen: Array) -> Screened:
        """Secants of the residual along the amplitude (and its quadrature, where there is a phase) against itself."""
        amplitude, phase = effect.amplitude(), effect.of_role("phase")
        beliefs = np.zeros(len(self.residual) - len(seen[0]))  # rows of the priors
        columns = [np.concatenate([row - self.residual[: len(row)], beliefs]) for row in seen]
        D, r = self.cleared(np.array(columns).T), self.cleared(self.residual)
        size, power = float(np.linalg.norm(D)), float(r @ r)
        if not (0 < power < np.inf) or not np.isfinite(size) or size < 1e-9 * np.sqrt(power):
            return Screened(effect.id, 0.0, (start,), np.inf)
        factor, *_ = np.linalg.lstsq(D, -r, rcond=None)
        share = 1 - float(np.sum((r + D @ factor) ** 2)) / power
        size *= 1 / np.sqrt(len(seen))
        if phase is not None:
            start[phase] = float(np.arctan2(factor[1], factor[0]))
        scale = float(np.hypot(*factor)) if len(factor) == 2 else float(factor[0])
        reach = (0.9 * amplitude.lower, 0.9 * amplitude.upper)
        wanted = start[amplitude.name] * scale
        start[amplitude.name] = float(np.clip(wanted, *reach))
        if not reach[0] <= wanted <= reach[1] and wanted * start[amplitude.name] <= 0:
            share = 0.0
        return Screened(effect.id, share, (start,), abs(effect.probe) * float(np.sqrt(power)) / size)


def _shapes(effect: type[Effect], records: Sequence[Record]) -> Iterator[dict[str, float]]:
    grid = {key: list(values) for key, values in effect.grid.items() if key != effect.of_role("phase")}
    position = effect.of_role("place")
    if position is not None:
        x = np.concatenate([record["position_m"] for record in records])
        low, high = np.percentile(x, [1, 99])
        grid[position] = np.linspace(low, high, SET.positions).tolist()
    for values in itertools.product(*grid.values()):
        yield dict(zip(grid, values, strict=True))


def _by_share(row: Screened) -> float:
    return -row.share


def screen(
    kind: Kind, records: Sequence[Record], effects: Sequence[str], theta: Theta, dropped: Sequence[str] = ()
) -> list[Screened]:
    """Every candidate's share of the residual beyond `effects`, best first: the larger of what the views show."""
    rows: dict[str, Screened] = {}
    for criterion in (kind.free_run, *((kind.criteria,) if kind.slow_view else ())):
        fitter = Fitter.of(kind, records, effects, criterion)
        view = _View.at(fitter, fitter.near(theta, [SET.screened_secant], 2 * SET.opened).theta)
        for row in view.best((*effects, *dropped)):
            other = rows.get(row.effect, row)
            better = row if row.share >= other.share else other
            starts = row.starts if other is row else (*row.starts, *other.starts)
            rows[row.effect] = replace(better, starts=starts)
    return sorted(rows.values(), key=_by_share)


def records_for_null(kind: Kind, part: Sequence[Record]) -> list[Record]:
    """What of `part` is imitated: the first few seconds of time series with an observer, else all."""
    if kind.criteria == 1 or any(TIME not in record.columns for record in part):
        return list(part)
    ends = np.cumsum([np.ptp(record[TIME]) for record in part])
    return prefixes(part[: 1 + int(np.searchsorted(ends, SET.imitated_s))], SET.imitated_s)


def null_distribution(
    kind: Kind, records: Sequence[Record], theta: Theta, rng: np.random.Generator
) -> tuple[float, dict[str, float], float]:
    """The null distribution, from imitated records without an effect: the largest gain -ln(1 - share) over all
    candidates, the smallest amplitude of each that exceeds it, and the mean square of the residuals. Where a slip event
    of an imitation depends on the step of the computation, the base is refitted to it, as it was to the records.
    """
    gain, cost, weakest = 0.0, 0.0, dict[str, float]()
    for imitated in [[kind.imitate(record, theta, rng) for record in records] for _ in range(SET.imitations)]:
        fitter = Fitter.of(kind, imitated, [])
        own, left = theta, judged_cost(kind, imitated, theta)
        if left > SET.near:
            again = fitter.near(theta, SET.fine).theta
            own, left = min((own, left), (again, judged_cost(kind, imitated, again)), key=lambda fit: fit[1])
        cost = max(cost, left)
        rows = _View.at(fitter, own).best()
        gain = max(gain, *(-float(np.log1p(-min(row.share, 0.999))) for row in rows)) if rows else gain
        for row in rows:
            weakest[row.effect] = max(weakest.get(row.effect, 0.0), row.sensitivity)
    return gain, {name: value * float(np.sqrt(gain)) for name, value in weakest.items() if np.isfinite(value)}, cost
