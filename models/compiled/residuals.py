"""Differences between what was measured and what a model says, in one pass: a fit makes them millions of times."""

import math
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def differences(measured: Array, predicted: Array, noise_std: float, most: float) -> Any:
    """`(measured - predicted)/noise_std` (n,), within -`most` and `most`; `most` too where it is no number."""
    r = np.empty(len(measured))
    for k in range(len(r)):
        d = (measured[k] - predicted[k]) / noise_std
        r[k] = max(d, -most) if d <= most else most
    return r


@nb.njit(cache=True, nogil=True, error_model="numpy")
def less_in_the_tail(r: Array, tail: float) -> Any:
    """Pseudo-Huber `r sqrt(2/(1 + sqrt(1 + (r/tail)^2)))`: `r` (n,) where small, then root of 2 `tail` |r|."""
    out = np.empty(len(r))
    for k in range(len(r)):
        share = r[k] / tail
        out[k] = r[k] * math.sqrt(2.0 / (1.0 + math.sqrt(1.0 + share * share)))
    return out


def products(rows: Array) -> Array:
    """rows @ rows.T"""
    return rows @ rows.T
