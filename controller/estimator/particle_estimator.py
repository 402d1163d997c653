"""The particle estimator: friction that sticks or slips leaves more than one place where the wall may be, and all of them are kept."""

from __future__ import annotations

import numpy as np

from controller.estimator.cloud import Cloud
from controller.estimator.noise import Noise
from controller.estimator.particles import expected
from controller.estimator.receiver import Receiver
from controller.prediction import ControlModel
from controller.signals import Estimate, Measurement


class ParticleEstimator(Receiver):
    """A particle filter with the control model as its process (`Cloud`).

    The position is the mean of all, wall, slip and drive are those of one particle that leads. A coil's current is the same for all: its
    reading moves every particle by what it differs from their mean, as it was when it was read. `count`: with 150 a coil's capsule was lost for a
    moment over folds in two of eight runs, with 300 in none; behind a magnet 100 do as well.
    """

    def __init__(self, model: ControlModel, noise: Noise | None = None, *, count: int = 300) -> None:
        super().__init__(model, noise)
        self._cloud = Cloud(model, self.noise, self._kept, count)
        self._commands, self._currents = np.zeros(self._kept), np.zeros(self._kept)
        self._cloud.compile()
        self.reset(0.0, 0.0)

    def reset(self, now: float, command: float) -> None:
        """Know nothing but the `command` in force at `now`; the draws begin anew."""
        super().reset(now, command)
        self._cloud.draws = np.random.default_rng(0)

    def _begin(self, position_m: float, now: float) -> None:
        self._cloud.begin(position_m, self._command, now)
        self._keep(self._command)

    def _go_on(self, now: float, command: float) -> None:
        self._cloud.move(command + self._offset, now)
        self._keep(command)

    def _keep(self, command: float) -> None:
        place = self._cloud.newest % self._kept
        self._commands[place] = command
        if self._current is not None:
            self._currents[place] = expected(self._cloud.weights, self._cloud.states[:, self._current])[0]

    def _told(self, back: int) -> float:
        return float(self._commands[(self._cloud.newest - back) % self._kept])

    def _fuse(self, back: int, m: Measurement) -> bool:
        if m.channel == "position_m":
            return self._cloud.see_position(back, m.value) <= self.noise.gate
        off = m.value - self._currents[(self._cloud.newest - back) % self._kept]
        self._cloud.states[:, self._current] += off
        self._currents += off
        return True

    def _estimate(self, now: float) -> Estimate | None:
        cloud = self._cloud
        found = cloud.survey()
        if found is None:
            return None
        state, level, force = found
        lacking, adapted = cloud.where.adapted(state, cloud.time_s, level, force)
        return Estimate(now, state, cloud.std.copy(), lacking, self._watch.lost(now, float(cloud.std[0])), adapted)
