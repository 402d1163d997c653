"""Sensors of records and instruments of a session: rate, delay, low-pass, hidden effects, noise, faults."""

import math
from dataclasses import dataclass

import numpy as np

from plant.hidden.registry import LAG_SHARES, ONSET, ROW, ROWS
from plant.hidden.table import begun, effect_table
from plant.tables import Floats

FASTEST_HZ = 1e6  # sampling rate
MOST = 1e3
"""Largest noise, error, quantum and span (m or N), delay, latency and time constant (s) of a sensor or instrument."""
_OFFSETS = ("sensor_scale", "sensor_bias", "sensor_drift", "mains_hum")


@dataclass(frozen=True)
class Sensor:
    """A sensor: samples at `rate_Hz`, delayed by `delay_s`, low-passed with `lowpass_s` (first order), with white noise
    of `noise_std`, rounded to multiples of `quantum` (0: not). Hidden offsets count in `span`, its range (0: the range
    of its readings). Noise, quantum and span are in the unit of the measured column.
    """

    rate_Hz: float = 500.0
    noise_std: float = 0.0
    quantum: float = 0.0
    delay_s: float = 0.0
    lowpass_s: float = 0.0
    span: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.rate_Hz <= FASTEST_HZ:
            raise ValueError(f"sensor rate_Hz must be positive and at most {FASTEST_HZ:g}; got {self.rate_Hz:g}")
        for name, value in vars(self).items():
            if name != "rate_Hz" and not 0 <= value <= MOST:
                raise ValueError(f"sensor {name} must lie in [0, {MOST:g}]; got {value:g}")

    def measure(self, t: Floats, y: Floats, rng: np.random.Generator, h: Floats | None = None) -> tuple[Floats, Floats]:
        """Sample times in s and readings of the truth `y` over the even grid `t`; `h` is the table of hidden effects.
        Order: low-pass, delay (the first value before the start), hidden gain and offsets, noise, rounding.
        """
        if t.size < 2:
            raise ValueError(f"a sensor must see two or more samples of the truth; got {t.size}")
        step = float(t[1] - t[0])
        if h is not None and h[ROW.sensor_lowpass, 0] > 0:
            for share in LAG_SHARES:
                y = _lowpassed(y, step, share * float(h[ROW.sensor_lowpass, 0]))
        y = self.filtered(t, y)
        late = self.delay_s + (0.0 if h is None else float(h[ROW.sensor_delay, 0]))
        when = t[0] + np.arange(math.floor((t[-1] - t[0]) * self.rate_Hz + 1e-9) + 1) / self.rate_Hz
        reading = np.interp(when - late, t, y)
        if h is not None:
            reading = with_hidden_errors(when, reading, h, self.span or float(np.ptp(reading)))
        reading = reading + self.noise_std * rng.standard_normal(when.size)
        return when, np.round(reading / self.quantum) * self.quantum if self.quantum > 0 else reading

    def filtered(self, t: Floats, y: Floats) -> Floats:
        return _lowpassed(y, float(t[1] - t[0]), self.lowpass_s)


def _lowpassed(y: Floats, step: float, time: float) -> Floats:
    """First-order low-pass, exact for straight lines between samples."""
    if time <= 0:
        return y
    from scipy.signal import lfilter

    a = math.exp(-step / time)
    share = time / step * (1 - a)
    b0, b1 = 1 - share, share - a
    return np.asarray(lfilter([b0, b1], [1.0, -a], y, zi=[y[0] * (b1 + a)])[0])


def with_hidden_errors(t: Floats, y: Floats, h: Floats, span: float) -> Floats:
    """Readings `y` at the times `t` in s with hidden gain and offsets, which count in `span`."""
    y = y * (1 + h[ROW.sensor_scale, 0]) + h[ROW.sensor_bias, 0] * span
    drift, hum = h[ROW.sensor_drift], h[ROW.mains_hum, 0]
    y = y + drift[0] * span * np.log1p((t - drift[ONSET]) / drift[1])
    return np.asarray(y + hum * span * (np.sin(2 * np.pi * 50 * t) + 0.3 * np.sin(2 * np.pi * 150 * t)))


@dataclass(frozen=True)
class Reading:
    """`value` of the column `channel`, SI, true at `stamp_s`, available from `arrives_s` on."""

    channel: str
    value: float
    stamp_s: float
    arrives_s: float


@dataclass(frozen=True)
class Instrument:
    """Samples at `rate_Hz`, available `latency_s` later, with white noise of `std`, rounded to `quantum` (0: not). A
    share `missing_share` of the readings is lost and `outlier_share` is off by up to `outlier_size` either way. In each
    pair of `gaps_s` (start, length, start, length, ...) no reading comes; in `nan_s` NaN. Hidden offsets count in
    `span`, its range. `std`, `quantum`, `outlier_size` and `span` are in the unit of the measured column.
    """

    rate_Hz: float = 100.0
    std: float = 0.5e-3
    latency_s: float = 8e-3
    quantum: float = 0.0
    missing_share: float = 0.0
    outlier_share: float = 0.0
    outlier_size: float = 20e-3
    span: float = 20e-3
    gaps_s: tuple[float, ...] = ()
    nan_s: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not self.rate_Hz > 0:
            raise ValueError(f"instrument rate_Hz must be positive; got {self.rate_Hz:g}")
        for name, value in vars(self).items():
            most = 1.0 if name.endswith("share") else MOST
            if isinstance(value, tuple):
                if len(value) % 2:
                    raise ValueError(f"instrument {name} must be pairs of start and length; got {len(value)} numbers")
            elif name != "rate_Hz" and not 0 <= value <= most:
                raise ValueError(f"instrument {name} must lie in [0, {most:g}]; got {value:g}")


class Stream:
    """A running instrument. The same truth gives the same readings in any number of pieces. `truth_rate_Hz` is the rate
    of the truth; a sample is the newest truth at its time.
    """

    def __init__(
        self,
        channel: str,
        instrument: Instrument,
        rng: np.random.Generator,
        truth_rate_Hz: float,
        hidden: Floats | None,
    ) -> None:
        self.channel, self.instrument, self._rng = channel, instrument, rng
        self._hidden = h = effect_table({}) if hidden is None else hidden
        time, late = float(h[ROW.sensor_lowpass, 0]), float(h[ROW.sensor_delay, 0])
        stages = LAG_SHARES if time > 0 else ()
        self._shares = tuple(1 - math.exp(-1 / (truth_rate_Hz * share * time)) for share in stages)
        self._offset = any(h[ROWS[name], 0] != 0.0 for name in _OFFSETS)
        self._late = round(late * truth_rate_Hz)
        self._late_from, self._smooth_from = float(h[ROW.sensor_delay, ONSET]), float(h[ROW.sensor_lowpass, ONSET])
        self._past: list[float] = []
        self._smooth: list[float] = []
        self._samples = 0

    def take(self, t: Floats, y: Floats) -> list[Reading]:
        """Readings of the samples within the truth `y` at the times `t` in s, (n,) both."""
        if not t.size:
            return []
        values = y.tolist()
        if self._shares:
            smooth = [self._smoothed(value) for value in values]
            values = [s if when >= self._smooth_from else v for s, v, when in zip(smooth, values, t, strict=True)]
        seen = (self._past or [values[0]] * self._late) + values if self._late else values
        readings, k = [], -1
        while (k := max(int(t.searchsorted(self._samples / self.instrument.rate_Hz - 1e-9)), k + 1)) < len(values):
            self._samples += 1
            readings.append(self._sample(float(t[k]), seen[k] if t[k] >= self._late_from else values[k]))
        self._past = seen[len(values) :]
        return [reading for reading in readings if reading is not None]

    def _smoothed(self, value: float) -> float:
        self._smooth = self._smooth or [value] * len(self._shares)
        for k, share in enumerate(self._shares):
            self._smooth[k] += share * (value - self._smooth[k])
            value = self._smooth[k]
        return value

    def _sample(self, t: float, value: float) -> Reading | None:
        """One reading; every sample draws the same random numbers, so faults do not shift the noise."""
        i = self.instrument
        noise, missing, wild, size = self._rng.standard_normal(), *self._rng.random(3)
        if self._offset:
            there = begun(self._hidden, t)
            value = float(with_hidden_errors(np.array([t]), np.array([value]), there, i.span)[0])
        value += i.std * noise
        if wild < i.outlier_share:
            value += i.outlier_size * (2 * size - 1)
        if i.quantum > 0:
            value = round(value / i.quantum) * i.quantum
        if missing < i.missing_share or _within(t, i.gaps_s):
            return None
        return Reading(self.channel, math.nan if _within(t, i.nan_s) else value, t, t + i.latency_s)


def _within(t: float, spans: tuple[float, ...]) -> bool:
    return any(start <= t < start + length for start, length in zip(spans[::2], spans[1::2], strict=True))
