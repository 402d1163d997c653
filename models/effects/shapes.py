"""Dimensionless shapes of a curve over one signal, for terms that are proposed from a residual. Each works for numbers,
arrays, CasADi symbols and formulas, since an effect's hook calls it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from models.formula import interpolated, shown_as


def line(z: Any, scale: Any) -> Any:
    """`z/scale`."""
    return z / scale


def parabola(z: Any, middle: Any, scale: Any) -> Any:
    """`((z - middle)/scale)^2`."""
    return ((z - middle) / scale) ** 2


def decay(z: Any, length: Any, begin: Any) -> Any:
    """`exp(-(z - begin)/length)`."""
    return np.exp(-(z - begin) / length)


def line_and_decay(z: Any, slope: Any, length: Any, begin: Any) -> Any:
    """`slope (z - begin)/length + exp(-(z - begin)/length)`: falls at first, then rises, as friction over speed may."""
    q = (z - begin) / length
    return slope * q + np.exp(-q)


def step(z: Any, middle: Any, width: Any) -> Any:
    """`tanh((z - middle)/width)`."""
    return np.tanh((z - middle) / width)


def bump(z: Any, middle: Any, width: Any) -> Any:
    """`exp(-((z - middle)/width)^2/2)`."""
    return np.exp(-0.5 * ((z - middle) / width) ** 2)


def wave(z: Any, length: Any, phase: Any) -> Any:
    """`sin(2 pi z/length + phase)`."""
    return np.sin(2 * np.pi * z / length + phase)


def knots(z: Any, places: Sequence[float], values: Sequence[float]) -> Any:
    """Straight between `values` (n,) at the ascending `places` (n,), and level beyond them."""
    y: Any = values[0]
    for left, right, low, high in zip(places, places[1:], values, values[1:], strict=False):
        y = y + (high - low) / (right - left) * (np.minimum(np.maximum(z, left), right) - left)
    return shown_as(y, lambda: interpolated(z, places, values))
