"""Time: stamps in another unit, repeated, uneven, missing or restarted; and two columns with different clocks."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
import scipy

from models.checks.estimators import Array, runs_of
from models.checks.finding import Findings, Severity
from models.checks.positions import jumps, without_steps
from models.checks.settings import SET
from models.checks.usable import gone
from models.checks.view import View
from models.records.record import USED
from models.rigs.columns import TIME
from models.rigs.tables import MOST_DRIFT

_GAIN_DRIFTING, _GAIN_FOLLOWING = 0.03, 0.15  # share of the misfit of unseen strokes, over a constant shift
_BY_CHANCE = 2.0  # strokes that a lag and a drift may explain though nothing drifts
_SINGULAR = 1e-6  # of the squares of a unit column: what part of a loop the other strokes do not show
_REACHES = tuple(0.0004 * 1.8**k for k in range(10))  # of the span


def check_interval(view: View) -> Findings:
    """The usual interval between stamps, and what they span, against what a record may have."""
    usual, span, (low, high) = float(np.median(np.abs(np.diff(view.t)))), float(np.ptp(view.t)), SET.step_s
    line = view.unit_line(TIME)
    if usual and not low <= usual <= high:
        yield view.stops("time_units.interval", TIME, step=usual, low=low, high=high, line=line)
    elif span < SET.record_s and _too_fast(view, span):
        yield view.stops("time_units.fast", TIME, span=span, step=view.dt, line=line)
    elif span < SET.record_s:
        yield view.weakens("time_units.short", TIME, span=span, n=len(view.t), step=view.dt, line=line)


def _too_fast(view: View, span: float) -> bool:
    """Whether a place goes through its whole travel within the record faster than such rigs move."""
    usual = SET.usual_m_s if view.kind.of_capsule and not view.kind.stage else SET.usual_stage_m_s
    usual = SET.usual_rad_s if view.turns else usual
    there = view.moving_column in view.record.columns
    return there and float(np.ptp(view.record[view.moving_column])) / max(span, 1e-300) > usual[1]


def check_left_out(view: View) -> Findings:
    """What the reading left out or restored."""
    for one in view.record.left_out:
        if one.why == "outside" and one.share < SET.lost_little:
            continue
        case = f"{one.why}.few" if one.why == "stamps_repeated" else one.why
        severity: Severity = "note" if one.share < SET.lost_much else "weakens"
        yield view.finding(severity, case, one.column, one.where, sentence=one.sentence)


def check_sparse_values(view: View) -> Findings:
    """Cells of the measured column that the file leaves empty, and stretches of them."""
    if USED in view.record.columns:
        there = view.record[USED] > 0
        rate = float(there.mean()) / view.dt
        yield view.notes("sparse_values", n=int(there.sum()), total=len(there), rate=rate)
        if lost := runs_of(gone(view.record)):
            longest = max(b - a for a, b in lost) * view.dt
            yield view.weakens("pause.measured", rows=[a for a, _ in lost], n=len(lost), longest=longest)


def check_restart(view: View) -> Findings:
    """Stamps that go back."""
    back = np.flatnonzero(np.diff(view.t) < 0) + 1
    if len(back) > SET.stamps_back * len(view.t):
        yield view.stops("stamps_reversed", TIME, first=view.t[0], last=view.t[-1])
    elif len(back):
        first = int(back[0])
        before, after, line = view.t[first - 1], view.t[first], view.record.line(first)
        yield view.stops("stamps_restart", TIME, back, n=len(back), before=before, after=after, line=line)


def check_repeats(view: View) -> Findings:
    """Stamps that stand twice."""
    same = np.flatnonzero(np.diff(view.t) == 0) + 1
    if len(same):
        yield view.stops("stamps_repeated", TIME, same, n=len(same))


def check_uneven(view: View) -> Findings:
    """Stamps that jitter, samples that are missing, and long gaps."""
    steps = np.diff(view.t) / view.dt
    usual = steps[(steps > SET.stamps_short) & (steps < 1.5)]
    jitter = float(np.std(usual)) if np.any(usual) else 0.0
    if jitter > SET.stamps_uneven:
        yield view.notes("stamps_uneven", TIME, jitter=jitter, step=view.dt)
    lost = np.flatnonzero((steps > 1.5) & (steps <= SET.stamps_pause)) + 1
    if len(lost):
        count = int(np.sum(np.round(steps[lost - 1]) - 1))
        share = count / (count + len(view.t))
        yield view.finding(
            "note" if share < SET.lost_much else "weakens", "stamps_missing", TIME, lost, n=count, share=share
        )
    gaps = np.flatnonzero(steps > SET.stamps_pause) + 1
    if len(gaps):
        longest, line = float(np.max(np.diff(view.t)[gaps - 1])), view.record.line(int(gaps[0]))
        yield view.weakens("pause", TIME, gaps, n=len(gaps), longest=longest, limit=SET.stamps_pause, line=line)


@dataclass(frozen=True)
class Lag:
    """By how many s a column is late (negative: early) at the record's first stamp, by how much more with every
    second, and the share of a friction loop's misfit that shifting it removes.
    """

    first_s: float
    drift: float
    gain: float


def check_delay(view: View) -> Findings:
    """Whether the force of a pull or a stage is late or early against the motion, or drifts; and whether the position
    of a capsule drifts against its magnet's, behind which it lags anyway.
    """
    moved, measured = view.kind.layout.own() if view.kind.led else ("", "")
    lag = _lag_of(view.unbroken, moved, measured) if {moved, measured} <= set(view.record.columns) else None
    if lag is None or not (lag.drift or view.kind.drawn) or (lag.drift and len(jumps(view))):
        return
    known = f"[clock] offset_s = {lag.first_s:.3g}"
    late = {"lag": abs(lag.first_s), "late": lag.first_s > 0, "gain": lag.gain}
    if not lag.drift:
        line = f"{known}, offset_std_s = {SET.lag_std_s:g}"
        yield view.notes("clock_offset", measured, beside=moved, line=line, **late)
        return
    case, line = "clock_drift", drift_line(view, lag.drift)
    if view.kind.drawn:
        case = "clock_drift.pull"
        line = f"{known}, offset_std_s = {SET.lag_drift_std_s:g}, {line.removeprefix('[clock] ')}"
    yield view.weakens(case, measured, beside=moved, drift=abs(lag.drift), later=lag.drift > 0, line=line, **late)


def drift_line(view: View, drift: float) -> str:
    """The line of `[clock]` that takes out a further `drift`."""
    return f"[clock] drift = {drift + (view.rig.clock.drift if view.rig.clock else 0.0):.3g}"


def _lag_of(view: View, moved: str, measured: str) -> Lag | None:
    """How late `measured` is behind the motion of the column `moved`; None where the record does not show it: the shift
    at which a friction loop leaves the smallest residual. The loop is a sum of plays of several widths, of friction
    that follows the sign of the speed more or less gradually, of speed and of slope; behind a magnet all but the speed
    may grow over the record.
    """
    turns = view.t[view.moves][1:][np.diff(np.sign(view.speed[view.moves])) != 0]
    length = float(view.t[-1] - view.t[0])
    if len(turns) < 3 or length < 20 * SET.lag_longest_s:
        return None
    x, moving = without_steps(view, view.record[moved]), view
    if moved != view.moving_column:
        moving = View(view.record.with_column(view.moving_column, view.record[moved]), view.rig)
    y = np.clip(view.record[measured], *np.percentile(view.record[measured], [0.5, 99.5]))  # impacts would weigh most
    fine, rough = (Shifted.of(view, x, moving.speed, y, rows) for rows in (SET.lag_rows, SET.lag_rows_rough))
    lags = np.linspace(-_margin_s(), _margin_s(), 141)
    best = float(lags[np.argmin([rough.left(lag, 0.0) for lag in lags])])
    _, offset = min(
        (float(fine.left(lag, 0.0)), float(lag)) for lag in best + np.ptp(lags[:2]) * np.linspace(-1, 1, 21)
    )
    ends = np.linspace(-SET.lag_most_drifted_s, SET.lag_most_drifted_s, 41)
    first, then = np.divmod(int(np.argmin([rough.left(lag, ends) for lag in lags[::4]])), len(ends))
    found = scipy.optimize.minimize(
        lambda at: fine.left(*at),
        (lags[4 * first], ends[then]),
        method="Nelder-Mead",
        bounds=[(lags[0], lags[-1]), (ends[0], ends[-1])],
        options={"xatol": 5e-4, "maxfev": 120},
    )
    middle, drifted = (float(value) for value in found.x)
    least, most = SET.lag_samples * view.dt, min(SET.lag_most_drifted_s, MOST_DRIFT * length)
    least_gain = max(_GAIN_FOLLOWING, _BY_CHANCE / (len(turns) + 1)) if view.kind.follows else _GAIN_DRIFTING
    if max(SET.lag_drifted_s, least) < abs(drifted) < most and abs(middle - drifted / 2) < SET.lag_longest_s:
        gain = 1 - fine.unseen(middle, drifted, turns) / max(fine.unseen(offset, 0.0, turns), 1e-300)
        if gain > least_gain:
            return Lag(middle - drifted / 2, drifted / length, gain)
    gain = 1 - float(fine.left(offset, 0.0)) / max(float(fine.left(0.0, 0.0)), 1e-300)
    there = max(SET.lag_s, least) < abs(offset) < SET.lag_longest_s and gain > SET.lag_gain
    return Lag(offset, 0.0, gain) if there else None


def _margin_s() -> float:
    """The largest lag in the middle of a record."""
    return float(SET.lag_longest_s + SET.lag_most_drifted_s / 2)


@dataclass(frozen=True)
class Shifted:
    """What a friction loop leaves of a column that is shifted in time: the column `y` by time, at even times `at` in s,
    `share` of the record from its middle; `within` (n, p) are orthonormal rows of the loop.
    """

    y: Callable[[Array], Array]
    at: Array
    share: Array
    within: Array

    @classmethod
    def of(cls, view: View, x: Array, speed: Array, y: Array, rows: int) -> Self:
        """The loop over the position `x` and its `speed`, on about so many `rows`."""
        begin, end = float(view.t[0]), float(view.t[-1])
        even = np.arange(begin, end, max(view.dt, (end - begin) / rows))
        inner = (even > begin + _margin_s()) & (even < end - _margin_s())
        at, share = even[inner], (even[inner] - (begin + end) / 2) / (end - begin)
        loop = _loop(np.interp(even, view.t, x), np.interp(even, view.t, speed))[inner]
        if view.kind.follows:  # a wall that dries lets the capsule come later and later, in both directions alike
            loop = np.column_stack([loop, share[:, None] * np.delete(loop, 2, axis=1)])
        return cls(_interpolation(view.t, y), at, share, np.linalg.qr(loop)[0])

    def _moved(self, lag: float, drifted: float | Array) -> Array:
        return self.y(self.at + lag + np.multiply.outer(drifted, self.share))

    def left(self, lag: float, drifted: float | Array) -> Array:
        """Sum of squares where the column is late by `lag` s in the middle and drifts by `drifted` s (one or more)."""
        moved = self._moved(lag, drifted)
        return np.asarray(np.sum(moved**2, axis=-1) - np.sum((moved @ self.within) ** 2, axis=-1))

    def unseen(self, lag: float, drifted: float, turns: Array) -> float:
        """The same of strokes between the `turns` in s, each by the loop of all others. A stroke is one piece of
        evidence: slip events move all of it in time, and a loop fitted to few of them fits whatever their shift is.
        """
        rows, left = np.column_stack([self.within, self._moved(lag, drifted)]), 0.0
        strokes = np.searchsorted(turns, self.at)
        squares = [rows[strokes == k].T @ rows[strokes == k] for k in range(int(strokes[-1]) + 1)]
        for own, rest in zip(squares, sum(squares) - np.array(squares), strict=True):
            loop = np.linalg.solve(rest[:-1, :-1] + _SINGULAR * np.eye(len(rest) - 1), rest[:-1, -1])
            left += float(own[-1, -1] - 2 * own[-1, :-1] @ loop + loop @ own[:-1, :-1] @ loop)
        return left


def _interpolation(t: Array, y: Array) -> Callable[[Array], Array]:
    """`y` (n,) straight between the rising times `t`, by times within them; where `t` is even, without a search."""
    step, rises = (t[-1] - t[0]) / (len(t) - 1), np.append(np.diff(y), 0.0)
    if np.max(np.abs(t - np.linspace(t[0], t[-1], len(t)))) > SET.stamps_even * step:
        return lambda at: np.interp(at, t, y)

    def interpolated(at: Array) -> Array:
        place = np.clip((at - t[0]) / step, 0, len(t) - 1)
        row = place.astype(np.intp)
        return np.asarray(y[row] + (place - row) * rises[row])

    return interpolated


def _loop(x: Array, speed: Array) -> Array:
    """Plays of several widths over `x`, what follows the `speed`, and `x` itself, shape (n, 18)."""
    span, usual = float(np.ptp(x)), float(np.percentile(np.abs(speed), 90))
    loops = [x - _play(x, reach * span) for reach in _REACHES]
    signs = [np.tanh(speed / max(share * usual, 1e-300)) for share in SET.lag_soft]
    rows = np.column_stack([np.ones_like(x), x, speed, *signs, *loops])
    return np.asarray(rows / np.maximum(np.sqrt(np.mean(rows**2, axis=0)), 1e-300))


def _play(x: Array, width: float) -> Array:
    out, position = [], float(x[0])
    for value in x.tolist():
        if position < value - width:
            position = value - width
        elif position > value + width:
            position = value + width
        out.append(position)
    return np.array(out)
