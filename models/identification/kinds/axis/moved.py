"""How an axis moved in a record: filtered motion, sure directions, rests, path; the noise of its position and force."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import comb

import numpy as np
from numpy.typing import NDArray

from models.checks.estimators import regressed, runs_of
from models.checks.speeds import agreement
from models.checks.usable import used
from models.identification.kind import Array
from models.identification.kinds.axis.coordinates import Coordinates
from models.identification.kinds.axis.zero_phase import (
    AxisMotion,
    decimate,
    motion,
    passed,
    quiet_roughness,
    reduction,
    repeat_lag,
    sampling_rate,
)
from models.identification.settings import SET
from models.records.record import Record


@dataclass(frozen=True)
class Moved:
    """The motion; the sign of its speed where it exceeds the noise of the position (standard deviation
    `position_noise`), less below; where the axis rests, its direction is unsure or a gap is near (`still`); the logged
    speed where it agrees with the position's; the path in m.
    """

    motion: AxisMotion
    direction: Array
    still: NDArray[np.bool_]
    position_noise: float
    logged: Array | None
    path: Array

    def part(self, record: Record) -> Moved:
        """That of a part of the record, filtered before the cut."""
        m, rows = self.motion, slice(record.first, record.first + len(record))
        own = AxisMotion(record["t_s"], m.x[rows], m.v[rows], m.a[rows])
        logged = None if self.logged is None else self.logged[rows]
        return Moved(own, self.direction[rows], self.still[rows], self.position_noise, logged, self.path[rows])


def moved(record: Record, c: Coordinates, position_std: float | None, band: float) -> Moved:
    """The motion of a whole `record`; `position_std` where it is stated, `band` of the filters in Hz."""
    position = record[c.position]
    m = motion(record["t_s"], position, band=band)
    logged = record.columns.get(c.velocity)
    if logged is not None:
        apart = float(np.sqrt(np.mean((m.v - logged) ** 2)))
        found = agreement(position, logged, 1 / m.rate)
        close = apart < SET.axis_agrees * float(np.sqrt(np.mean(m.v**2))) and (found is None or found.close)
        logged = logged if close else None
    if logged is not None:
        m = motion(record["t_s"], position, logged, band)
    position_noise = position_std or white_part(position)
    still = _still(m, position_noise, band) | _beside_gaps(~used(record), m.rate, band)
    path = np.cumsum(np.abs(np.diff(m.x, prepend=m.x[:1])))
    return Moved(m, _direction(m, position_noise, band), still, position_noise, logged, path)


def _unsure(m: AxisMotion, std: float, band: float) -> float:
    """Standard deviation in m/s of the speed that is noise of the position."""
    return through(round(m.rate, 3), band, False)[0] * std


def _direction(m: AxisMotion, std: float, band: float) -> Array:
    unsure = 2 * _unsure(m, std, band)
    return np.clip(m.v / unsure, -1, 1) if unsure > 0 else np.sign(m.v)


def _beside_gaps(unused: NDArray[np.bool_], rate: float, band: float) -> NDArray[np.bool_]:
    """The rows of gaps, and as far beside them as the filters reach."""
    out, reach = np.zeros_like(unused), round(SET.border / band * rate)
    for a, b in runs_of(unused):
        if b - a >= SET.axis_gap - 1:
            out[max(a - reach, 0) : b + reach] = True
    return out


def _still(m: AxisMotion, std: float, band: float) -> NDArray[np.bool_]:
    fast = np.abs(m.v)
    out = fast < 2 * _unsure(m, std, band)
    for a, b in runs_of(fast < max(SET.axis_rest * float(np.percentile(fast, 99)), 4 * _unsure(m, std, band))):
        out[a:b] |= (b - a) > SET.axis_rest_s * m.rate
    return out


@dataclass(frozen=True)
class AxisNoise:
    """Standard deviations: `force` of the filtered force (NaN: unknown), `speed` of a logged speed before the filter,
    `weight` of the filtered force error of a right model; `inertia` multiplies the noise of the acceleration.
    """

    force: float
    speed: float
    inertia: float
    weight: float


def filtered_noise(force: Array, position: Array, rate: float, band: float, stated: float | None) -> float:
    """Noise of the filtered force: as stated, else of repeats, else its roughness; NaN where it may be a command."""
    if stated is not None:
        return stated * passed(rate, band)
    filtered = decimate(force, rate)
    least = SET.axis_best * float(np.sqrt(np.mean(filtered**2)))
    lag = repeat_lag(position, rate)
    if lag is not None:
        std = float(np.std(decimate(force[lag:] - force[:-lag], rate, band))) / np.sqrt(2)
        return std if std > least else np.nan
    std, finer = (quiet_roughness(filtered, order=k) / _shown(rate, k) for k in (2, 4))
    if std < least or finer < SET.axis_white * std:
        return np.nan
    if finer < SET.quite * std or std < SET.quite * finer:  # not quite white: no more is claimed than shows
        std *= _shown(rate, 2)
    return std * passed(rate, band) / passed(rate)


@lru_cache(maxsize=64)
def _shown(rate: float, order: int) -> float:
    """`quiet_roughness` of filtered white noise over its standard deviation."""
    white = decimate(_white(rate, SET.band_hz), rate)
    return quiet_roughness(white, order=order) / float(np.std(white))


def _white(rate: float, band: float) -> Array:
    """White noise at `rate` Hz that is long enough for the filter of the `band`."""
    least = 4 * round(SET.border / band * rate) + 200 * reduction(rate, band)
    return np.random.default_rng(0).standard_normal(int(max(SET.axis_rows, least)))


def white_part(signal: Array) -> float:
    """Standard deviation of a signal's white noise, 0 for none: sixth differences, free of motion, against fourth."""
    if len(signal) < 20:
        return 0.0
    fourth, sixth = (float(np.median(np.abs(np.diff(signal, k)))) / 0.6745 / np.sqrt(comb(2 * k, k)) for k in (4, 6))
    return sixth if sixth > SET.axis_white * fourth else 0.0


@lru_cache(maxsize=32)
def through(rate: float, band: float, logged: bool) -> tuple[float, float]:
    """Standard deviations of speed and acceleration under unit white noise on the position (or a `logged` speed)."""
    white = _white(rate, band)
    t = np.arange(white.size) / rate
    m = motion(t, np.zeros(white.size), white, band) if logged else motion(t, white, band=band)
    return float(np.std(m.v)), float(np.std(decimate(m.a, rate, band)))


def band_of(t: Array, position: Array, stated: float | None) -> float:
    """The widest band in Hz, 20 Hz and halves of it, in which the acceleration exceeds the noise of the position (as
    `stated`, else estimated); a noisy acceleration would draw the inertia down.
    """
    std, rate = stated or white_part(position), round(sampling_rate(t), 3)
    bands: list[float] = [SET.band_hz / 2**k for k in range(SET.axis_halvings)]
    clear = (
        band
        for band in bands
        if std * through(rate, band, False)[1]
        < SET.axis_clear * float(np.std(decimate(motion(t, position, band=band).a, rate, band)))
    )
    return next(clear, bands[-1])


def inertia_of(force: Array, m: AxisMotion, band: float) -> float:
    """Mass (inertia) by linear regression of the force, for the effect of a noisy acceleration."""
    rows = np.column_stack([m.a, m.v, np.sign(m.v), m.x, np.ones_like(m.a)])
    filtered = np.column_stack([decimate(column, m.rate, band) for column in rows.T])
    return abs(float(regressed(filtered, decimate(force, m.rate, band))[0]))
