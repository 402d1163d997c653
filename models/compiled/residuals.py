"""What a fit makes of a model's output, compiled: a fit needs it millions of times. One thread; no state is kept."""

import math
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
_COLUMNS = 512  # of `products` at a time: two dozen rows of it stay in a core's own cache


@nb.njit(cache=True, nogil=True, error_model="numpy")
def in_time(samples: Array, late: Array, steps: int, first: int, every: int) -> Any:
    """Columns (steps, lanes) of `samples` (n,) that are so many samples `late` (lanes,), put back in time: number k at
    step `first + every k`, straight between them and constant beyond.
    """
    last = len(samples) - 1
    out = np.empty((steps, len(late)))
    for k in range(steps):
        for lane in range(len(late)):
            at = min(max((k - first) / every + late[lane], 0.0), float(last))
            j = int(at)
            out[k, lane] = samples[j] if at == j else (samples[j + 1] - samples[j]) * (at - j) + samples[j]
    return out


@nb.njit(cache=True, nogil=True, error_model="numpy")
def sampled(shown: Array, clock: Array, times: Array, late: Array, same: bool, rows: Rows, out: Array) -> None:
    """Columns of `shown` (n, lanes) at the stamps `clock` (n,) as `rows` of `out` at `times` (m,), each `late` (lanes,)
    in s, straight between; the very numbers where nothing is late and `times` are the `same` as `clock`.
    """
    if same and not late.any():
        for k in range(len(times)):
            for lane in range(len(rows)):
                out[rows[lane], k] = shown[k, lane]
        return
    for lane in range(len(rows)):
        j, last = 0, len(clock) - 1
        for k in range(len(times)):
            at = min(max(times[k] - late[lane], clock[0]), clock[last])
            while j < last and clock[j + 1] <= at:
                j += 1
            y = shown[j, lane]
            if at != clock[j]:
                y += (shown[j + 1, lane] - y) / (clock[j + 1] - clock[j]) * (at - clock[j])
            out[rows[lane], k] = y


@nb.njit(cache=True, nogil=True, error_model="numpy")
def lagging(signal: Array, steps: float) -> Any:
    """`signal` (n,) through a first-order low-pass over so many `steps`, straight between, from rest at its first."""
    out = signal.copy()
    if steps <= 1e-3:
        return out
    kept = math.exp(-1 / steps)
    share = steps * (1 - kept)
    for k in range(1, len(out)):
        out[k] = kept * out[k - 1] + (1 - share) * signal[k] + (share - kept) * signal[k - 1]
    return out


@nb.njit(cache=True, nogil=True, error_model="numpy")
def weighed(
    predicted: Array, measured: Array, counted: Rows, averaged: int, noise_std: float, most: float, tail: float
) -> Any:
    """Residuals (lanes, m // averaged) of `predicted` (lanes, n) at the rows `counted` (m,): `(measured - predicted) /
    noise_std`, within -`most` and `most`, and `most` where it is no number; means of `averaged` neighbours times the
    root of it, which keeps white noise's variance; of these r the pseudo-Huber `r sqrt(2/(1 + sqrt(1 + (r/tail)^2)))`:
    r where small, then root of 2 `tail` |r|.
    """
    out = np.empty((len(predicted), len(counted) // averaged))
    d, per, root = np.empty(len(measured)), 1.0 / noise_std, math.sqrt(averaged) / averaged
    for lane in range(len(out)):
        of, row = predicted[lane], out[lane]
        for k in range(len(d)):
            off = (measured[k] - of[k]) * per
            d[k] = max(off, -most) if off <= most else most
        for i in range(len(row)):
            total = d[counted[i * averaged]]
            for k in range(i * averaged + 1, (i + 1) * averaged):
                total += d[counted[k]]
            row[i] = total * root
        for i in range(len(row)):
            share = row[i] / tail
            row[i] *= math.sqrt(2.0 / (1.0 + math.sqrt(1.0 + share * share)))
    return out


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def products(rows: Array) -> Any:
    """`rows @ rows.T` (p, p) of `rows` (p, m), for normal equations: the same to the last bit whenever `rows` are."""
    p, m = rows.shape
    out = np.zeros((p, p))
    for start in range(0, m, _COLUMNS):
        for i in range(p):
            one = rows[i, start : start + _COLUMNS]
            for j in range(i + 1):
                other, total = rows[j, start : start + _COLUMNS], 0.0
                for k in range(len(one)):
                    total += one[k] * other[k]
                out[i, j] += total
    for i in range(p):
        for j in range(i):
            out[j, i] = out[i, j]
    return out
