"""Two clocks: a measured column that comes later or earlier than the motion."""

from __future__ import annotations

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.instrument.resolution import without_steps
from models.checks.view import Array, View

_LONGEST_S = 0.15
_LEAST_SAMPLES = 2.0
_LEAST_S = 0.012  # what stick and slip alone may look like
_TOLD_TO_S = 0.004  # standard deviation of what is told
_GAIN = 0.03  # share of the misfit that the shift must take away
_SOFT = (0.01, 0.025, 0.06, 0.15, 0.4)  # of the usual speed, below which friction changes its sign gradually
_REACHES = tuple(0.0004 * 1.8**k for k in range(10))  # of the span
_ROWS = 8000


def check_delay(view: View) -> list[RecordFinding]:
    """Whether the force of a pull or a stage answers the motion late or early."""
    if view.kind != "pull" or not view.timed or "force_N" not in view.record.columns:
        return []
    told = clock_offset(view)
    if told is None:
        return []
    offset, gain = told
    later = "later" if offset > 0 else "earlier"
    return [
        view.finding(
            "clock_offset",
            "note",
            "force_N against position_m, throughout",
            f"force_N comes about {1e3 * abs(offset):.0f} ms {later} than the motion that makes it: two clocks, a"
            " filter or a slow sensor",
            f"a friction loop through force and motion fits {100 * gain:.0f} % better with the force moved by so much",
            f"[clock] offset_s = {offset:.3g} and offset_std_s = {_TOLD_TO_S:g}",
        )
    ]


def clock_offset(view: View) -> tuple[float, float] | None:
    """Time in s by which the force is late (negative: early), and the share of a friction loop's misfit that this takes
    away; None where the record tells none. The loop is a sum of plays of several widths, friction that follows the
    sign of the speed more or less gradually, speed and slope.
    """
    strokes = np.sign(view.speed[view.moves])
    length = float(view.t[-1] - view.t[0])
    if np.sum(np.diff(strokes) != 0) < 3 or length < 20 * _LONGEST_S:
        return None
    even = np.arange(view.t[0], view.t[-1], max(view.dt, length / _ROWS))
    x = np.interp(even, view.t, without_steps(view, view.record["position_m"]))
    basis = _loop(x, np.interp(even, view.t, view.speed))
    inner = (even > even[0] + _LONGEST_S) & (even < even[-1] - _LONGEST_S)

    whole = view.record["force_N"]
    whole = np.clip(whole, *np.percentile(whole, [0.5, 99.5]))  # outliers would weigh most
    within, _ = np.linalg.qr(basis[inner])

    def left(lag: float) -> float:
        force = np.interp(even[inner] + lag, view.t, whole)
        return float(force @ force - np.sum((within.T @ force) ** 2))

    lags = np.linspace(-_LONGEST_S, _LONGEST_S, 61)
    coarse = np.array([left(lag) for lag in lags])
    best = int(np.argmin(coarse))
    if best in (0, len(lags) - 1):
        return None
    fine = np.linspace(lags[best - 1], lags[best + 1], 21)
    again = np.array([left(lag) for lag in fine])
    offset, gain = float(fine[np.argmin(again)]), 1 - float(again.min()) / max(left(0.0), 1e-300)
    return (offset, gain) if abs(offset) > max(_LEAST_S, _LEAST_SAMPLES * view.dt) and gain > _GAIN else None


def _loop(x: Array, speed: Array) -> Array:
    """Plays of several widths over `x`, what follows the `speed`, and `x` itself, shape (n, 18)."""
    span, usual = float(np.ptp(x)), float(np.percentile(np.abs(speed), 90))
    loops = [x - _play(x, reach * span) for reach in _REACHES]
    signs = [np.tanh(speed / max(share * usual, 1e-300)) for share in _SOFT]
    rows = np.column_stack([np.ones_like(x), x, speed, *signs, *loops])
    return np.asarray(rows / np.maximum(np.sqrt(np.mean(rows**2, axis=0)), 1e-300))


def _play(x: Array, width: float) -> Array:
    out = np.empty_like(x)
    place = float(x[0])
    for i, value in enumerate(x.tolist()):
        place = min(max(place, value - width), value + width)
        out[i] = place
    return out
