"""The filter of a laboratory without a friction model: position and speed from localisation alone."""

import math
from collections.abc import Sequence

import numpy as np

from controller.estimator.base import MOST_A_TICK, Watch, Watched, Wrong
from controller.model.control_model import ControlModel
from controller.signals import Estimate, Measurement
from controller.tuned import FilterNoise

_START_SPEED_M_S = 5e-3  # standard deviation before any measurement


class KinematicFilter(Watched):
    """Kalman filter of `x' = v, v' = w` (w white), corrected at each position's stamp and extrapolated to now by `x + v
    (now - stamp)`; wall and drive stay at the model's start. Outliers, lost estimates and faults as in `Estimator`;
    positions older than the last one are not used. `jerkiness`: random walk of the speed over a second, in m/s per root
    s; larger is quicker and noisier. Raises ValueError on construction unless it is positive, later never.
    """

    def __init__(self, model: ControlModel, jerkiness: float = 5e-3, noise: FilterNoise | None = None) -> None:
        if not 0 < jerkiness < math.inf:
            raise ValueError(f"jerkiness must be a positive number; got {jerkiness!r}")
        self.model, self.jerkiness = model, jerkiness
        self.noise = FilterNoise() if noise is None else noise
        self._blank, self.offset = model.initial(), 0.0
        self._watch = Watch(self.noise)
        self.reset(0.0, 0.0)

    def reset(self, now: float, command: float) -> None:
        self._stamp = -math.inf
        self._x = self._v = math.nan
        self._watch = Watch(self.noise, self.counts)
        self._pxx = self._pxv = self._pvv = 0.0

    def observe(self, now: float, command: float, measurements: Sequence[Measurement] = ()) -> Estimate:
        """The estimate at `now` from the positions among `measurements`; `command` is not used."""
        for m in measurements[-MOST_A_TICK:]:
            if m.channel == "position_m":
                self._take(m.value, m.stamp_s - self.model.delay_s, now)
        if math.isnan(self._x):
            nothing = np.full(len(self._blank), math.nan)
            return Estimate(now, nothing, nothing, 0.0, True)
        state, std, ahead = self._blank.copy(), np.zeros(len(self._blank)), max(now - self._stamp, 0.0)
        state[0], state[1] = self._x + self._v * ahead, self._v
        std[0] = math.sqrt(max(self._pxx + 2 * ahead * self._pxv + ahead * ahead * self._pvv, 0.0))
        std[1] = math.sqrt(max(self._pvv, 0.0))
        return Estimate(now, state, std, 0.0, self._watch.lost(now, float(std[0])))

    def _take(self, value: float, stamp: float, now: float) -> None:
        if not (math.isfinite(value) and math.isfinite(stamp)) or stamp <= self._stamp or stamp > now:
            self.counts.unusable += 1
            return
        if math.isnan(self._x):
            self._begin(value, stamp, now)
            return
        dt, q = stamp - self._stamp, self.jerkiness**2
        pxx = self._pxx + dt * (2 * self._pxv + dt * self._pvv) + q * dt**3 / 3
        pxv, pvv = self._pxv + dt * self._pvv + q * dt * dt / 2, self._pvv + q * dt
        innovation, spread = value - self._x - self._v * dt, pxx + self.noise.position_std_m**2
        if innovation * innovation > self.noise.gate**2 * spread:
            if self._watch.refuse(value, stamp, now) is not Wrong.NOTHING:
                self._begin(value, stamp, now)
            return
        kx, kv = pxx / spread, pxv / spread
        self._x, self._v = self._x + self._v * dt + kx * innovation, self._v + kv * innovation
        self._pxx, self._pxv, self._pvv = (1 - kx) * pxx, (1 - kx) * pxv, pvv - kv * pxv
        self._stamp = stamp
        self._watch.accept(value, stamp, now)

    def _begin(self, value: float, stamp: float, now: float) -> None:
        self._x, self._v, self._stamp = value, 0.0, stamp
        self._pxx, self._pxv, self._pvv = self.noise.position_std_m**2, 0.0, _START_SPEED_M_S**2
        self._watch.begin(now)
