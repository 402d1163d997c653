"""A particle filter: each particle is a possible capsule with its own wall, friction level and force."""

import math
from typing import Final

import casadi as ca
import numpy as np

from controller.estimator.base import START_STD, Estimator
from controller.estimator.kernels import draw, expected, led, scatter, survey, weigh
from controller.estimator.periodic import Periodic
from controller.model.control_model import ControlModel
from controller.signals import Array, Measurement
from controller.tuned import FilterNoise

_RENEWED: Final = 0.5  # share of effective particles below which all are resampled
_LEADS: Final = np.array([1.5, 1.5, 2.5])
"""Standard deviations of position, level and wall beyond which a leader no longer represents the particles."""
SCATTER_S: Final = 0.01  # between two draws of the random walks
PARTICLES: Final = 300
_REDRAWN_1_S: Final = 0.3  # rate at which a particle redraws whether its level is brisk


class ParticleEstimator(Estimator):
    """A particle filter with the control model as its process: `count` particles with `_states` (P, n), `_levels`,
    `_forces`, a `_brisk` level or not (P,) and `_weights` (P,). Only position, level and force walk; the rest follows
    from the model. `_past` (kept, P) has the sensor readings of each particle in earlier ticks, so a late position
    weighs each by its position then. Particles of little weight are replaced by copies of heavier ones. The random
    draws restart with `reset`: same measurements, same estimate.

    The position is the mean of all particles. Wall, slip and drive are those of one leading particle until it is far
    off the mean, because a mean does not stick and slip. A current reading shifts every particle by its difference from
    their mean then.

    With 150 particles a coil's capsule was lost over folds in two of eight runs, with 300 in none; with a magnet 100
    suffice.
    """

    def __init__(self, model: ControlModel, noise: FilterNoise | None = None, *, count: int = PARTICLES) -> None:
        super().__init__(model, noise)
        P, n = count, len(model.states)
        self._size, self._states, self._past = P, np.zeros((P, n)), np.zeros((self._kept, P))
        self._levels, self._forces, self._brisk, self._weights = (np.zeros(P) for _ in range(4))
        self._periodic = Periodic.of(model, P)
        self._which = np.append(self._level.index, self._periodic.index)
        self._values = np.zeros((self._which.size, P))
        self._chosen, self._normals, self._chances = np.zeros(P, dtype=np.int64), np.zeros((3, P)), np.zeros(P)
        self._every = max(1, round(SCATTER_S / model.tick_s))
        self._bounds = np.array([self._level.low, self._level.high])
        self._mean, self._std, self._currents = np.zeros(n), np.zeros(n), np.zeros(self._kept)
        self._modes = [model.index(name) for name in model.modes]
        self._wall = model.states.index("u") if "u" in model.states else 0
        self._sensor = self._shown()
        self._compile()
        self.reset(0.0, 0.0)

    def _shown(self) -> ca.Function | None:
        """The sensor's reading of every particle; None if it is the position."""
        return None if self.model.placed else self.model.measured.map(self._size)

    def _compile(self) -> None:
        """Run everything once, so that the machine code exists before the first tick."""
        self.reset(0.0, 0.0)
        self._begin(0.0, 0.0)
        for k in range(self._every):
            self._predict(k * self.model.tick_s, 0.0)
        self._see_position(0, 0.0)
        self._renew()
        self._estimate()

    def reset(self, now: float, command: float) -> None:
        """As `Estimator.reset`; the random draws restart."""
        super().reset(now, command)
        self._draws = np.random.default_rng(0)

    def _begin(self, position_m: float, now: float) -> None:
        model, noise, normal, P = self.model, self.noise, self._draws.standard_normal, self._size
        self._states[:] = model.initial(position_m, self._command)
        for k, name in enumerate(model.states):
            if isinstance(name, str) and name in START_STD:
                self._states[:, k] += START_STD[name] * normal(P)
        self._states[:, 0] += noise.position_std_m * normal(P)
        level_std = noise.fitted_level_std if model.fitted else noise.level_std
        self._levels[:] = np.clip(level_std * normal(P), *self._bounds)
        self._forces[:] = noise.force_std_N * normal(P)
        self._brisk[:] = self._draws.random(P) < 0.5
        self._periodic.begin()
        self._weights[:] = 1 / P
        self._newest, self._average, self._leader = 0, 0.0, -1
        self._remember(now, self._command)

    def _predict(self, now: float, command: float) -> None:
        k, before = self.model.kernels, self.model.command_from(self._drive, command)
        self._values[0] = self._level.middle * (1 + self._levels)
        self._values[1:] = self._periodic.values
        moved = (self._states, before, command, self._forces, self._time_s, k.tick_s, k.substeps, k.parameters)
        k.run_each(self._which, self._values, *moved)
        self._newest += 1
        if self._newest % self._every == self._every // 2:
            self._scatter()
        self._remember(now, command)

    def _scatter(self) -> None:
        noise, passed = self.noise, self._every * self.model.tick_s
        force, place = noise.walks(self._average)
        walks = np.array([place, noise.level_wander, noise.brisk_level_wander, force]) * math.sqrt(passed)
        self._draws.standard_normal(out=self._normals)
        self._draws.random(out=self._chances)
        moved = (self._states[:, 0], self._levels, self._forces, self._brisk)
        scatter(*moved, np.append(walks, _REDRAWN_1_S * passed), self._bounds, self._normals, self._chances)
        self._periodic.scatter(self._draws, passed, force > noise.force_wander_N, self._levels, self._weights)

    def _remember(self, now: float, command: float) -> None:
        self._time_s, self._drive, place = now, command, self._newest % self._kept
        shown = self._states[:, 0]
        if self._sensor is not None:
            shown = np.asarray(self._sensor(self._states.T, now)).ravel()
        self._past[place] = shown
        if self._current is not None:
            self._currents[place] = expected(self._weights, self._states[:, self._current])[0]

    def _fuse(self, back: int, m: Measurement) -> float:
        if m.channel == "position_m":
            return self._see_position(back, m.value)
        off = m.value - self._currents[(self._newest - back) % self._kept]
        self._states[:, self._current] += off
        self._currents += off
        return 0.0

    def _see_position(self, back: int, value: float) -> float:
        then, variance = self._past[(self._newest - back) % self._kept], self.noise.position_std_m**2
        mean, square = expected(self._weights, then)
        size = (value - mean) / math.sqrt(square + variance)
        if abs(size) <= self.noise.gate:
            self._average = self.noise.surprised(self._average, size)
            if weigh(self._weights, then, value, variance) < _RENEWED * self._size:
                self._renew()
        return size

    def _shift(self, back: int, position_m: float) -> None:
        off = position_m - expected(self._weights, self._past[(self._newest - back) % self._kept])[0]
        self._states[:, 0] += off + self.noise.position_std_m * self._draws.standard_normal(self._size)
        self._past += off

    def _renew(self) -> None:
        chosen = self._chosen
        draw(self._weights, self._draws.random(), chosen)
        for rows in (self._states, self._past.T, self._levels, self._forces, self._brisk):
            rows[:] = rows[chosen]
        self._periodic.take(chosen)
        self._weights[:] = 1 / self._size
        copies = np.flatnonzero(chosen == self._leader)
        self._leader = int(copies[0]) if copies.size else -1

    def _estimate(self) -> tuple[Array, Array, float, float] | None:
        w, mean, std = self._weights, self._mean, self._std
        level, force = survey(w, self._states, self._levels, self._forces, mean, std)
        if not math.isfinite(mean.sum() + std.sum() + level + force):
            return None
        self._level.values[self._periodic.index] = self._periodic.mean(w)
        self._leader = led(w, self._states, self._levels, self._wall, mean, std, level, _LEADS, self._leader)
        state: Array = self._states[self._leader].copy()
        state[0] = mean[0]
        std[self._modes] = 0.0
        return state, std.copy(), level, force
