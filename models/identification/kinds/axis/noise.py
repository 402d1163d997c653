"""The noise of an axis: of its force, where anything tells it, and what the noise of its position makes of that."""

from dataclasses import dataclass
from functools import lru_cache
from math import comb

import numpy as np

from models.identification.kinds.axis.zero_phase import (
    Array,
    AxisMotion,
    decimate,
    motion,
    passed,
    quiet_roughness,
    repeat_lag,
    sampling_rate,
)
from models.identification.settings import SET


@dataclass(frozen=True)
class AxisNoise:
    """Standard deviations: `force` of the filtered force (None: nothing tells it), `speed` of a logged speed before the
    filter, `weight` of the filtered force error of a right model; `inertia` is what a noisy acceleration shakes.
    """

    force: float | None
    speed: float
    inertia: float
    weight: float


def told_force(force: Array, position: Array, rate: float, band: float, stated: float | None) -> float | None:
    """Noise of the filtered force: as stated, else of repeats, else its roughness; None where it may be a command."""
    if stated is not None:
        return stated * passed(rate, band)
    filtered = decimate(force, rate)
    least = SET.axis_best * float(np.sqrt(np.mean(filtered**2)))
    lag = repeat_lag(position, rate)
    if lag is not None:
        std = float(np.std(decimate(force[lag:] - force[:-lag], rate, band))) / np.sqrt(2)
        return std if std > least else None
    std, finer = (quiet_roughness(filtered, order=k) / _shown(rate, k) for k in (2, 4))
    if std < least or finer < SET.axis_white * std:
        return None
    if finer < SET.quite * std or std < SET.quite * finer:  # not quite white: what shows is all that can be claimed
        std *= _shown(rate, 2)
    return std * passed(rate, band) / passed(rate)


@lru_cache(maxsize=64)
def _shown(rate: float, order: int) -> float:
    """What `quiet_roughness` shows of filtered white noise, over its standard deviation."""
    white = decimate(np.random.default_rng(0).standard_normal(SET.axis_rows), rate)
    return quiet_roughness(white, order=order) / float(np.std(white))


def white_part(signal: Array) -> float:
    """Standard deviation of a signal's white noise, 0 for none: sixth differences, free of motion, against fourth."""
    if len(signal) < 20:
        return 0.0
    fourth, sixth = (float(np.median(np.abs(np.diff(signal, k)))) / 0.6745 / np.sqrt(comb(2 * k, k)) for k in (4, 6))
    return sixth if sixth > SET.axis_white * fourth else 0.0


@lru_cache(maxsize=32)
def through(rate: float, band: float, logged: bool) -> tuple[float, float]:
    """Standard deviations that white noise of standard deviation 1 on the position (on the speed where that is
    `logged`) leaves on the speed, and on the acceleration after the force's filter; 1/s and 1/s^2 (1 and 1/s).
    """
    white = np.random.default_rng(0).standard_normal(SET.axis_rows)
    t = np.arange(SET.axis_rows) / rate
    m = motion(t, np.zeros(SET.axis_rows), white, band) if logged else motion(t, white, band=band)
    return float(np.std(m.v)), float(np.std(decimate(m.a, rate, band)))


def band_of(t: Array, position: Array, stated: float | None) -> float:
    """The widest band in Hz, 20 Hz and halves of it, in which the noise of the position (as `stated`, else as it shows)
    leaves the acceleration clear; a noisy acceleration would draw the inertia down.
    """
    place, rate = stated or white_part(position), round(sampling_rate(t), 3)
    bands: list[float] = [SET.band_hz / 2**k for k in range(SET.axis_halvings)]
    clear = (
        band
        for band in bands
        if place * through(rate, band, False)[1]
        < SET.axis_clear * float(np.std(decimate(motion(t, position, band=band).a, rate, band)))
    )
    return next(clear, bands[-1])


def inertia_of(force: Array, m: AxisMotion, band: float) -> float:
    """Mass (inertia) that a line through the force gives: enough to tell what a noisy acceleration makes of it."""
    rows = np.column_stack([m.a, m.v, np.sign(m.v), m.x, np.ones_like(m.a)])
    filtered = np.column_stack([decimate(column, m.rate, band) for column in rows.T])
    scale = np.maximum(np.std(filtered, axis=0), 1e-300)
    scale[-1] = 1.0
    weights, *_ = np.linalg.lstsq(filtered / scale, decimate(force, m.rate, band), rcond=None)
    return abs(float(weights[0] / scale[0]))
