"""What a sensor makes of the truth: rate, delay, low-pass, the hidden sensor effects, noise, quantisation."""

import math
from dataclasses import dataclass

import numpy as np

from plant.hidden.registry import LAG_SHARES, ONSET, ROW
from plant.tables import Floats

FASTEST_HZ = 1e6  # sampling rate
MOST = 1e3
"""Largest noise, quantum and span (m or N), delay and time constant (s) that a sensor is given."""


@dataclass(frozen=True)
class Sensor:
    """A sensor: samples at `rate_Hz`, is late by `delay_s`, smooths with `lowpass_s` (first order), adds white noise of
    `noise_std` and rounds to multiples of `quantum` (0: not at all). Hidden offsets count in `span`, the range in which
    it works (0: the range of what it reads). Noise, quantum and span are in the unit of what is measured.
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
        Order: low-pass, delay (before the start the first value holds), hidden gain and offsets, noise, rounding.
        """
        if t.size < 2:
            raise ValueError(f"a sensor must see two or more samples of the truth; got {t.size}")
        step = float(t[1] - t[0])
        if h is not None and h[ROW.sensor_lowpass, 0] > 0:
            for share in LAG_SHARES:
                y = _lowpassed(y, step, share * float(h[ROW.sensor_lowpass, 0]))
        y = _lowpassed(y, step, self.lowpass_s)
        late = self.delay_s + (0.0 if h is None else float(h[ROW.sensor_delay, 0]))
        when = t[0] + np.arange(math.floor((t[-1] - t[0]) * self.rate_Hz + 1e-9) + 1) / self.rate_Hz
        reading = np.interp(when - late, t, y)
        if h is not None:
            reading = with_hidden_errors(when, reading, h, self.span or float(np.ptp(reading)))
        reading = reading + self.noise_std * rng.standard_normal(when.size)
        return when, np.round(reading / self.quantum) * self.quantum if self.quantum > 0 else reading


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
    """Readings `y` at the times `t` in s with hidden gain and offsets; offsets count in `span`."""
    y = y * (1 + h[ROW.sensor_scale, 0]) + h[ROW.sensor_bias, 0] * span
    drift, hum = h[ROW.sensor_drift], h[ROW.mains_hum, 0]
    y = y + drift[0] * span * np.log1p((t - drift[ONSET]) / drift[1])
    return np.asarray(y + hum * span * (np.sin(2 * np.pi * 50 * t) + 0.3 * np.sin(2 * np.pi * 150 * t)))
