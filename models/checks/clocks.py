"""Time: stamps in another unit, repeated, uneven, missing or restarted; and two columns with different clocks."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from models.checks.estimators import Array
from models.checks.finding import Findings
from models.checks.positions import jumps, without_steps
from models.checks.settings import SET
from models.checks.view import View
from models.records.record import USED
from models.rigs.columns import TIME
from models.rigs.tables import MOST_DRIFT

_GAIN_DRIFTING, _GAIN_FOLLOWING = 0.03, 0.15  # share of the misfit that a drift takes away, over a constant shift
_REACHES = tuple(0.0004 * 1.8**k for k in range(10))  # of the span


def check_interval(view: View) -> Findings:
    """The usual interval between stamps, and what they span, against what a record may have."""
    usual, span, (low, high) = float(np.median(np.abs(np.diff(view.t)))), float(np.ptp(view.t)), SET.step_s
    line = view.unit_line(TIME)
    if usual and not low <= usual <= high:
        yield view.stops("time_units.interval", TIME, step=usual, low=low, high=high, line=line)
    elif span < SET.record_s:
        yield view.weakens("time_units.short", TIME, span=span, n=len(view.t), step=view.dt, line=line)


def check_sparse_values(view: View) -> Findings:
    """Cells of the measured column that the file leaves empty."""
    if USED in view.record.columns:
        there = view.record[USED] > 0
        rate = float(there.mean()) / view.dt
        yield view.notes("sparse_values", n=int(there.sum()), total=len(there), rate=rate)


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
        yield view.finding("note" if share < 0.1 else "weakens", "stamps_missing", TIME, lost, n=count, share=share)
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
    lag = _lag_of(view, moved, measured) if {moved, measured} <= set(view.record.columns) else None
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
    strokes = np.sign(view.speed[view.moves])
    length = float(view.t[-1] - view.t[0])
    if np.sum(np.diff(strokes) != 0) < 3 or length < 20 * SET.lag_longest_s:
        return None
    x, moving = without_steps(view, view.record[moved]), view
    if moved != view.moving_column:
        moving = View(view.record.with_column(view.moving_column, view.record[moved]), view.rig)
    y = np.clip(view.record[measured], *np.percentile(view.record[measured], [0.5, 99.5]))  # impacts would weigh most
    left, rough = (_misfit(view, x, moving.speed, y, rows) for rows in (SET.lag_rows, SET.lag_rows_rough))
    least = SET.lag_samples * view.dt
    lags = np.linspace(-SET.lag_longest_s, SET.lag_longest_s, 61)
    best = int(np.argmin([left(lag, 0.0) for lag in lags]))
    fine = np.linspace(lags[max(best - 1, 0)], lags[min(best + 1, len(lags) - 1)], 21)
    constant = min((float(left(lag, 0.0)), float(lag)) for lag in fine)
    ends = np.linspace(-SET.lag_most_drifted_s, SET.lag_most_drifted_s, 41)
    first, then = np.divmod(int(np.argmin([rough(lag, ends) for lag in lags[::2]])), len(ends))
    start = (lags[2 * first], ends[then])
    found = scipy.optimize.minimize(
        lambda at: left(*at), start, method="Nelder-Mead", options={"xatol": 5e-4, "maxfev": 120}
    )
    middle, drifted = (float(value) for value in found.x)
    gain = 1 - float(found.fun) / max(constant[0], 1e-300)
    most = min(SET.lag_most_drifted_s, MOST_DRIFT * length)
    least_gain = _GAIN_FOLLOWING if view.kind.follows else _GAIN_DRIFTING
    if gain > least_gain and max(SET.lag_drifted_s, least) < abs(drifted) < most:
        return Lag(middle - drifted / 2, drifted / length, gain)
    gain, offset = 1 - constant[0] / max(float(left(0.0, 0.0)), 1e-300), constant[1]
    inside = 0 < best < len(lags) - 1
    return Lag(offset, 0.0, gain) if inside and abs(offset) > max(SET.lag_s, least) and gain > SET.lag_gain else None


def _misfit(view: View, x: Array, speed: Array, y: Array, rows: int) -> Callable[[float, float | Array], Array]:
    """The sum of squares that the loop over the position `x` and its `speed` leaves of `y`, by how late `y` is in the
    middle of the record and how far it drifts from beginning to end (one value or several); on about so many `rows`.
    """
    begin, end = float(view.t[0]), float(view.t[-1])
    even = np.arange(begin, end, max(view.dt, (end - begin) / rows))
    margin = SET.lag_longest_s + SET.lag_most_drifted_s / 2
    inner = (even > begin + margin) & (even < end - margin)
    at, share = even[inner], (even[inner] - (begin + end) / 2) / (end - begin)
    loop = _loop(np.interp(even, view.t, x), np.interp(even, view.t, speed))[inner]
    if view.kind.follows:  # a wall that dries lets the capsule come later and later, in both directions alike
        loop = np.column_stack([loop, share[:, None] * np.delete(loop, 2, axis=1)])
    within, _ = np.linalg.qr(loop)
    interpolated = _interpolation(view.t, y)

    def left(lag: float, drifted: float | Array) -> Array:
        moved = interpolated(at + lag + np.multiply.outer(drifted, share))
        return np.asarray(np.sum(moved**2, axis=-1) - np.sum((moved @ within) ** 2, axis=-1))

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
