"""What the model in use says the next second will be, and by how much it is off when the second is over."""

import math
from dataclasses import dataclass

import numpy as np

from controller.model.control_model import ControlModel
from controller.signals import Estimate

SPAN_S = 1.0
"""How far ahead is foretold."""
LEAST_READINGS = 5
"""Positions that must have come in a second for it to be judged."""
REMEMBERED = 2000
"""Positions by which the estimator's innovations are told how wide they are."""
SHIFT_S = 0.05
"""Of a shift in time that is looked for."""
STEADY_S = 0.4
"""After so long a steady speed is an offset to the estimator, and no delay is told by it."""


@dataclass(frozen=True, slots=True)
class Second:
    """A second that is over, SI: by how much the forecast of the position was off (`miss_m`) and how uncertain begin
    and end were (`std_m`), the mean of the estimator's standardised innovations and their number, how far the capsule
    `moved_m`, and the mean force along +x that the model's own parameters lacked.

    `ahead` is by how many standard deviations the capsule changed its speed earlier than foretold, negative where it
    was late: the score of a shift in time, `sum(i w) / sqrt(sum(w^2))` of the innovations `i`, as shares of their rms
    so far, with `w` the foretold speed less its low-pass over `STEADY_S`. `telling` is what `ahead` would be for a
    shift of `SHIFT_S`: nothing where the speed is steady.
    """

    miss_m: float
    std_m: float
    innovation: float
    readings: int
    moved_m: float
    lacking_N: float
    ahead: float
    telling: float


class Forecast:
    """Runs the model, with the friction level and force that the estimator believes, for `SPAN_S` from an estimate on
    under the commands in force: so far ahead no filter corrects it. `noise_m` is a localisation's standard deviation. A
    second in which the estimate was lost is none: sensors are not judged here. One state a tick.
    """

    def __init__(self, model: ControlModel, noise_m: float) -> None:
        self.model, self._noise_m = model, noise_m
        self._ticks = max(1, round(SPAN_S / model.tick_s))
        self._state, self._numbers = np.zeros((1, len(model.states))), model.values.copy()
        self._force = np.zeros(1)
        self._heard, self._square = 0, 1.0
        self._clear()
        self._share, self._speed = model.tick_s / (STEADY_S + model.tick_s), model.states.index("v")
        self.drop()

    def drop(self) -> None:
        """Forget the second that is under way."""
        self._k, self._time, self._command, self._steady_m_s = -1, math.nan, math.nan, 0.0

    def _clear(self) -> None:
        self._readings, self._sum, self._lacking, self._score, self._weight = 0, 0.0, 0.0, 0.0, 0.0

    def step(self, now: float, command: float, estimate: Estimate) -> Second | None:
        """A tick on, to the `estimate` at `now` which `command` led to; the second that it ends, or None."""
        if estimate.lost or not math.isfinite(command + float(estimate.state[0])):
            self.drop()
            return None
        if self._k < 0:
            self._begin(now, command, estimate)
            return None
        k, model = self.model.kernels, self.model
        before = model.left(self._command, command)
        k.run(self._state, before, command, self._force, self._time, k.tick_s, k.substeps, self._numbers)
        self._k, self._time, self._command = self._k + 1, now, command
        self._lacking += estimate.disturbance_N
        turning = float(self._state[0, self._speed]) - self._steady_m_s
        self._steady_m_s += self._share * turning
        for size in estimate.innovations:
            self._sum, self._readings = self._sum + size, self._readings + 1
            self._score, self._weight = self._score + size * turning, self._weight + turning * turning
            self._heard = min(self._heard + 1, REMEMBERED)
            self._square += (size * size - self._square) / self._heard
        if self._k < self._ticks:
            return None
        found = self._over(estimate) if self._readings >= LEAST_READINGS else None
        self._begin(now, command, estimate)
        return found

    def _begin(self, now: float, command: float, estimate: Estimate) -> None:
        adapted = estimate.adapted
        self._state[0] = estimate.state
        self._numbers[:] = self.model.values if adapted is None else adapted.parameters
        self._force[0] = estimate.disturbance_N if adapted is None else adapted.disturbance_N
        self._k, self._time, self._command = 0, now, command
        self._from, self._std = float(estimate.state[0]), float(estimate.std[0])
        self._clear()

    def _over(self, estimate: Estimate) -> Second | None:
        at = float(estimate.state[0])
        miss, std = at - float(self._state[0, 0]), math.hypot(self._std, float(estimate.std[0]))
        if not math.isfinite(miss + std):
            return None
        mean, lacking, rms = self._sum / self._readings, self._lacking / self._k, math.sqrt(self._square)
        ahead = self._score / (rms * math.sqrt(self._weight) or 1.0)
        telling = SHIFT_S * math.sqrt(self._weight) / (rms * self._noise_m or 1.0)
        return Second(miss, std, mean, self._readings, at - self._from, lacking, ahead, telling)
