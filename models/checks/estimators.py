"""Estimates of a column that several checks use: noise, grid, running mean, runs of rows."""

import weakref

import numpy as np
import scipy
from numpy.typing import NDArray

from models.checks.settings import SET

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
_OVERLAPPED = 0.95  # of the degrees of freedom of windows that overlap by half, what they count (Welch 1967)
_STEPS: dict[int, float] = {}  # of arrays by id
_ROUNDED = np.sqrt(12)  # steps over the standard deviation of what rounding to them leaves


def running_mean(x: Array, n: int) -> Array:
    """Mean over `2 n + 1` neighbours, fewer at the ends; shape of `x`."""
    total = np.concatenate([[0.0], np.cumsum(x - x[0])])
    at = np.arange(len(x))
    low, high = np.maximum(at - n, 0), np.minimum(at + n + 1, len(x))
    return np.asarray((total[high] - total[low]) / (high - low) + x[0])


def white_noise(x: Array) -> float:
    """Standard deviation of white noise on `x`, from the median of its second differences: motion hardly changes it."""
    return float(np.median(np.abs(np.diff(x, 2)))) / 0.6745 / np.sqrt(6) if len(x) > 2 else 0.0


def smooth_speed(x: Array, dt: float) -> tuple[Array, float, int]:
    """Speed of a place over the shortest window that shows more motion than noise, its noise, half that window."""
    noise = max(white_noise(x), step_noise(x))
    for window in SET.speed_windows_s:
        n = max(1, round(window / 2 / dt))
        ahead = np.minimum(np.arange(len(x)) + n, len(x) - 1)
        back = np.maximum(np.arange(len(x)) - n, 0)
        smooth, centre = running_mean(x, n), 0.5 * (ahead + back)
        speed = (smooth[ahead] - smooth[back]) / (np.maximum(centre[ahead] - centre[back], 0.5) * dt)
        left = noise * float(np.sqrt(2 / (2 * n + 1))) / (2 * n * dt)
        if 5 * left < SET.speed_shown * float(np.percentile(np.abs(speed), 90)):
            break
    return np.asarray(speed), left, n


def regressed(rows: Array, y: Array) -> Array:
    """Weights (m,) of the least-squares line through `y` (n,) by the columns of `rows` (n, m), brought to one size."""
    scale = np.std(rows, axis=0)
    scale[scale <= 1e-12 * np.max(np.abs(rows), axis=0)] = 1.0  # constant columns
    return np.asarray(np.linalg.lstsq(rows / scale, y, rcond=None)[0] / scale)


def spectral_noise(x: Array) -> tuple[float, bool]:
    """Standard deviation of white noise on `x`, from the quietest tenth of its spectrum (Welch, up to 256 samples a
    window), to which motion only adds; and whether the spectrum is flat there. Where it is not, the motion is louder
    than the noise at every frequency and the value is an upper bound, as it is of too few samples for a spectrum.
    """
    window = min(SET.spectrum_window, len(x) // 8)
    if window < 16:
        return white_noise(x), False
    _, power = scipy.signal.welch(x, nperseg=window, detrend="linear")
    quietest, quiet = np.quantile(power[2:-1], [SET.spectrum_quietest, SET.spectrum_quiet])
    degrees = _OVERLAPPED * 2 * (2 * len(x) / window - 1)
    # of white noise's mean, its quietest tenth by chi square
    chance = 2 * scipy.special.gammaincinv(degrees / 2, SET.spectrum_quietest) / degrees
    return float(np.sqrt(0.5 * quietest / chance)), bool(quiet < SET.spectrum_flat * quietest)


def grid_step(x: Array) -> float:
    """Step of the grid on which the values of `x` lie; 0 for none that is identifiable. Found once for an array."""
    if id(x) not in _STEPS:
        _STEPS[id(x)] = _grid_step(x)
        weakref.finalize(x, _STEPS.pop, id(x), None)
    return _STEPS[id(x)]


def _grid_step(x: Array) -> float:
    values = np.unique(x)
    gaps = np.diff(values)
    gaps = gaps[gaps > 1e-9 * max(float(np.ptp(x)), 1e-300)]
    if len(values) < 3 or len(values) > 0.5 * len(x) or not len(gaps):
        return 0.0
    step = float(np.mean(gaps[gaps < 1.5 * float(np.percentile(gaps, 10))]))
    off = np.abs(gaps / step - np.round(gaps / step))
    return step if float(np.mean(off < SET.grid_off)) > SET.grid_share else 0.0


def step_noise(x: Array) -> float:
    """Standard deviation of what the resolution of `x` adds to it."""
    return float(grid_step(x) / _ROUNDED)


def estimated_noise(y: Array, vibrates: bool, stated: float | None) -> float:
    """Standard deviation of the noise of a column's values `y` (n,): from its quieter stretches, because slip
    events only add to it. Where the rig `vibrates`, from the quieter part of the spectrum, or as `stated` where no part
    is quiet. At least what the resolution adds.
    """
    step = grid_step(y)
    if vibrates:
        std, shown = spectral_noise(y)
        return max(std if shown or stated is None else min(std, stated), float(step / _ROUNDED))
    pieces = np.array_split(y, max(1, min(40, len(y) // 100)))
    quiet = float(np.percentile([white_noise(piece) for piece in pieces], 40))
    if step > 0.5 * quiet:  # a median of steps is a step
        means = [float(np.mean(np.abs(np.diff(x, 2)))) * np.sqrt(np.pi / 12) if len(x) > 2 else 0.0 for x in pieces]
        quiet = float(np.percentile(means, 40))
    return max(quiet, float(step / _ROUNDED))


def runs_of(mask: Mask, least: float = 1) -> list[tuple[int, int]]:
    """Stretches (first row, row after the last) of at `least` so many rows where `mask` holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= least]
