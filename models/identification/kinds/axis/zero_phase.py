"""Speed, acceleration and low-passed force of a sampled axis without delay, as in EMPS (Janot et al. 2019)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from math import comb

import numpy as np
import scipy
from numba import njit

from models.identification.kind import Array
from models.identification.settings import SET
from models.records.record import USED, Record

_WINDOW = 25  # differences of which the quietest tenth shows the noise
_SHORTEST_S = 1.0  # cycle of a motion that repeats


@dataclass(frozen=True)
class AxisMotion:
    """Time in s, position in m (rad), speed and acceleration of one record, each (n,)."""

    t: Array
    x: Array
    v: Array
    a: Array

    @cached_property
    def rate(self) -> float:
        return sampling_rate(self.t)

    @cached_property
    def even(self) -> bool:
        return bool(_unevenness(self.t) <= SET.even)


@cache
def _low_pass(factor: int) -> Array:
    return np.asarray(scipy.signal.cheby1(8, 0.05, 0.8 / factor, output="sos"))


def sampling_rate(t: Array) -> float:
    """Samples per second of evenly spaced times."""
    return 1 / float(np.median(np.diff(t)))


def evened(record: Record, columns: Sequence[str]) -> Record:
    """`record` itself where its steps in time are even within 5 %, else its `columns` interpolated to even times of the
    same rate; samples in a gap of more than five usual steps do not count. Raises ValueError where half of the record
    or more lies in or beside gaps.
    """
    t = record["t_s"]
    if _unevenness(t) <= SET.even:
        return record
    steps = np.diff(t)
    usual = float(np.median(steps))
    long = steps > SET.axis_gap * usual
    step = float(np.mean(steps[~long]))
    gaps = np.count_nonzero(long)
    lost = float(np.sum(steps[long])) + 2 * SET.border / SET.band_hz * gaps
    if lost > SET.lost * (t[-1] - t[0]):
        worst = int(np.argmax(steps))
        raise ValueError(
            f"t_s must be evenly spaced to be differentiated, without steps above {SET.axis_gap:g} times the usual one"
            f" over most of it; got {gaps}, the longest of {steps[worst]:g} s at {t[worst]:.12g} s among {usual:g} s"
        )
    even = np.linspace(t[0], t[-1], round((t[-1] - t[0]) / step) + 1)
    there = {name: np.interp(even, t, record[name]) for name in columns if name in record.columns}
    if gaps:
        step_of = np.clip(np.searchsorted(t, even) - 1, 0, len(steps) - 1)
        bridged = long[step_of] & (even > t[step_of]) & (even < t[step_of + 1])
        there[USED] = np.where(bridged, 0.0, there.get(USED, np.ones(len(even))))
    return Record(record.name, record.kind, {"t_s": even, **there})


def _unevenness(t: Array) -> float:
    """Largest deviation of a step in time over the median step."""
    steps = np.diff(t)
    usual = float(np.median(steps))
    return float(np.max(np.abs(steps - usual))) / usual


def motion(t: Array, position: Array, velocity: Array | None = None, band: float = SET.band_hz) -> AxisMotion:
    """Butterworth of order 4, both ways, at five times the `band` in Hz, then differences; or the logged `velocity`."""
    rate = sampling_rate(t)
    sections = scipy.signal.butter(4, min(5 * band / (rate / 2), 0.8), output="sos")
    x = scipy.signal.sosfiltfilt(sections, position, padlen=min(12, len(position) - 1))
    if velocity is None:
        v = np.gradient(x, 1 / rate)
    else:
        v = np.asarray(scipy.signal.sosfiltfilt(sections, velocity, padlen=min(12, len(position) - 1)))
    return AxisMotion(t, np.asarray(x), v, np.gradient(v, 1 / rate))


def reduction(rate: float, band: float = SET.band_hz) -> int:
    """Factor of the down-sampling, so that twice the `band` is 0.8 of the Nyquist frequency that is left."""
    return max(1, round(0.8 * (rate / 2) / (2 * band)))


def decimate(signal: Array, rate: float, band: float = SET.band_hz) -> Array:
    """The authors' parallel filter along the last axis: cut the borders, low-pass (Chebyshev I, order 8, 0.05 dB, both
    ways, at twice the `band` in Hz), down-sample. Raises ValueError for a record that is too short.
    """
    factor = reduction(rate, band)
    border = round(SET.border / band * rate)
    if signal.shape[-1] < 2 * border + 3 * factor:
        least, got = (2 * border + 3 * factor) / rate, signal.shape[-1] / rate
        raise ValueError(f"an axis record must last at least {least:g} s to be filtered; got {got:g} s")
    inner = signal[..., border:-border] if border else signal
    if factor == 1:
        return inner
    return inner @ _operator(inner.shape[-1], factor) if inner.shape[-1] <= SET.short else _passed_down(inner, factor)


def _passed_down(inner: Array, factor: int) -> Array:
    """`scipy.signal.sosfiltfilt` along the last axis, of many rows at once in compiled code."""
    sections, rows = _low_pass(factor), np.ascontiguousarray(np.atleast_2d(inner).T)
    pad = min(24, len(rows) - 1)
    ends = 2 * rows[:1] - rows[pad:0:-1], 2 * rows[-1:] - rows[-2 : -2 - pad : -1]
    out = np.concatenate([ends[0], rows, ends[1]])
    for _ in range(2):
        _pass(sections, scipy.signal.sosfilt_zi(sections), out)
        out = out[::-1].copy()
    return np.ascontiguousarray(out[pad : pad + len(rows)][::factor].T).reshape(*inner.shape[:-1], -1)


@njit(nogil=True, cache=True, error_model="numpy")
def _pass(sections: Array, rest: Array, rows: Array) -> None:
    """The filter along the columns of `rows` (n, P), in place, at rest at the first row."""
    held = np.empty((len(sections), 2, rows.shape[1]))
    for j in range(len(sections)):
        for i in range(2):
            held[j, i] = rest[j, i] * rows[0]
    for k in range(len(rows)):
        for j in range(len(sections)):
            b0, b1, b2, _, a1, a2 = sections[j]
            for lane in range(rows.shape[1]):
                x = rows[k, lane]
                y = b0 * x + held[j, 0, lane]
                held[j, 0, lane] = b1 * x - a1 * y + held[j, 1, lane]
                held[j, 1, lane] = b2 * x - a2 * y
                rows[k, lane] = y


@lru_cache(maxsize=16)
def _operator(count: int, factor: int) -> Array:
    """The filter of `count` samples as a matrix: a search filters the same short pieces again and again."""
    return np.ascontiguousarray(_passed_down(np.eye(count), factor))


def passed(rate: float, band: float = SET.band_hz) -> float:
    """Standard deviation that `decimate` leaves of white noise of standard deviation 1."""
    factor = reduction(rate, band)
    if factor == 1:
        return 1.0
    _, gain = scipy.signal.sosfreqz(_low_pass(factor), 4096)
    return float(np.sqrt(np.mean(np.abs(gain) ** 4)))


def quiet_roughness(signal: Array, order: int) -> float:
    """Standard deviation of a signal's noise from its differences of an `order`, in its quietest tenth of windows."""
    bends = np.diff(signal, order) / np.sqrt(comb(2 * order, order))
    parts = bends[: len(bends) // _WINDOW * _WINDOW].reshape(-1, _WINDOW) if len(bends) >= _WINDOW else bends[None, :]
    return float(np.percentile(np.sqrt(np.mean(parts**2, axis=1)), 10))


def repeat_lag(position: Array, rate: float) -> int | None:
    """Samples after which the motion repeats to 1e-4 of its range over a third of the record, else None."""
    n = len(position)
    limit = 1e-4 * float(np.ptp(position))

    def mismatch(lag: int, stride: int) -> float:
        return float(np.sqrt(np.mean((position[lag::stride] - position[: n - lag : stride]) ** 2)))

    coarse = range(round(_SHORTEST_S * rate), 2 * n // 3, max(1, round(0.01 * rate)))
    scores = [mismatch(lag, 8) for lag in coarse]
    for i in range(1, len(scores) - 1):
        if scores[i] <= min(scores[i - 1], scores[i + 1]) and scores[i] < 100 * limit:
            fine = range(coarse[i - 1], coarse[i + 1] + 1)
            best = min(fine, key=lambda lag: mismatch(lag, 4))
            if mismatch(best, 1) < limit:
                return best
    return None
