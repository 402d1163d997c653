"""A set of particles, each with a wall, a friction level and a force of its own, that all could be the true one."""

import math
from dataclasses import dataclass, field
from typing import Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from controller.estimator.base import Estimator
from controller.estimator.friction_scale import Level
from controller.estimator.noise import START_STD
from controller.estimator.particle_kernels import draw, expected, led, scatter, survey, weigh
from controller.model.control_model import ControlModel
from controller.signals import Estimate, Measurement
from controller.tuned import FilterNoise

Array = NDArray[np.float64]
_RENEWED: Final = 0.5  # share of the particles below which the weights are worth so few that all are drawn anew
_LEADS: Final = np.array(
    [1.5, 1.5, 2.5]
)  # standard deviations of place, level and wall beyond which a leader no longer stands for the rest


@dataclass
class ParticleCloud:
    """`count` particles of the control `model` with the walks of `noise`: `states` (P, n) in the model's order,
    `level`, `force_N`, whether the level is `brisk` (P,) and `weights` (P,). Nothing but position, level and force
    walks: whatever else the model has follows from its past.

    `past` (kept, P) holds what the sensor would have shown of each particle in the ticks before, so that a late
    position weighs each by where it was then and nothing is computed again. Particles of little weight give way to
    copies of heavier ones. The draws follow from `draws` alone: the same measurements, the same estimate.
    """

    model: ControlModel
    noise: FilterNoise
    kept: int
    count: int = 300
    scatter_s: float = 0.01
    redrawn_1_s: float = 0.3
    draws: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    def __post_init__(self) -> None:
        model, P = self.model, self.count
        self.where = Level(model)
        self.states, self.past = np.zeros((P, len(model.states))), np.zeros((self.kept, P))
        self.level, self.force_N, self.brisk, self.weights, self._values = (np.zeros(P) for _ in range(5))
        self._chosen, self._normals, self._chances = np.zeros(P, dtype=np.int64), np.zeros((3, P)), np.zeros(P)
        self._every = max(1, round(self.scatter_s / model.tick_s))
        self._bounds = np.array([self.where.low, self.where.high])
        self.mean, self.std = np.zeros(len(model.states)), np.zeros(len(model.states))
        self._modes = [model.index(name) for name in model.modes]
        self._wall = model.states.index("u") if "u" in model.states else 0
        self._sensor = self._shown()
        self.newest, self.surprise, self.leader, self.time_s, self.command = 0, 0.0, -1, 0.0, 0.0

    def _shown(self) -> ca.Function | None:
        """What the sensor shows of every particle; None where that is the position."""
        x, t = ca.SX.sym("x", len(self.model.states)), ca.SX.sym("t")
        shown = self.model.measured(x, t)
        plain = bool(ca.is_equal(ca.simplify(shown), x[0], 2))
        return None if plain else ca.Function("shown", [x, t], [shown]).map(self.count)

    def compile(self) -> None:
        """Do everything once, so that machine code is there before the first tick; what is believed is lost."""
        self.begin(0.0, 0.0, 0.0)
        for k in range(self._every):
            self.move(0.0, k * self.model.tick_s)
        self.see_position(0, 0.0)
        self._renew()
        self.survey()

    def begin(self, position_m: float, command: float, now: float) -> None:
        """At rest about `position_m`, with `command` in force for long."""
        model, draws, P = self.model, self.draws, self.count
        self.states[:] = model.initial(position_m, command)
        for k, name in enumerate(model.states):
            if isinstance(name, str) and name in START_STD:
                self.states[:, k] += START_STD[name] * draws.standard_normal(P)
        self.states[:, 0] += self.noise.position_std_m * draws.standard_normal(P)
        level_std = self.noise.fitted_level_std if model.fitted else self.noise.level_std
        self.level[:] = np.clip(level_std * draws.standard_normal(P), *self._bounds)
        self.force_N[:] = self.noise.force_std_N * draws.standard_normal(P)
        self.brisk[:] = draws.random(P) < 0.5
        self.weights[:] = 1 / P
        self.newest, self.surprise, self.leader, self.time_s, self.command = 0, 0.0, -1, now, command
        self._remember()

    def move(self, command: float, now: float) -> None:
        """A tick on, to `now`, to the end of which `command` leads; a carriage goes there in a straight line."""
        k, before = self.model.kernels, self.model.left(self.command, command)
        self._values[:] = self.where.middle * (1 + self.level)
        own = (k.parameters, self.where.index, self._values)
        k.run_each(self.states, before, command, self.force_N, self.time_s, k.tick_s, k.substeps, *own)
        self.newest, self.time_s, self.command = self.newest + 1, now, command
        if self.newest % self._every == self._every // 2:
            self._scatter()
        self._remember()

    def _scatter(self) -> None:
        noise, passed = self.noise, self._every * self.model.tick_s
        force, place = noise.walks(self.surprise)
        walks = np.array([place, noise.level_wander, noise.brisk_level_wander, force]) * math.sqrt(passed)
        self.draws.standard_normal(out=self._normals)
        self.draws.random(out=self._chances)
        walks = np.append(walks, self.redrawn_1_s * passed)
        scatter(
            self.states[:, 0], self.level, self.force_N, self.brisk, walks, self._bounds, self._normals, self._chances
        )

    def _remember(self) -> None:
        shown = self.states[:, 0]
        if self._sensor is not None:
            shown = np.asarray(self._sensor(self.states.T, self.time_s)).ravel()
        self.past[self.newest % self.kept] = shown

    def see_position(self, back: int, value: float) -> float:
        """Take in a localisation that was true `back` ticks ago; returns its normalised difference, signed, beyond the
        gate where it was refused. NaN where the particles are no longer made of numbers.
        """
        then, variance = self.past[(self.newest - back) % self.kept], self.noise.position_std_m**2
        mean, square = expected(self.weights, then)
        size = (value - mean) / math.sqrt(square + variance)
        if abs(size) <= self.noise.gate:
            self.surprise = self.noise.surprised(self.surprise, size)
            if weigh(self.weights, then, value, variance) < _RENEWED * self.count:
                self._renew()
        return size

    def shift(self, back: int, value: float) -> None:
        """Move all particles, and where they were since, by what a localisation `back` ticks ago was off their mean."""
        off = value - expected(self.weights, self.past[(self.newest - back) % self.kept])[0]
        self.states[:, 0] += off + self.noise.position_std_m * self.draws.standard_normal(self.count)
        self.past += off

    def _renew(self) -> None:
        chosen = self._chosen
        draw(self.weights, self.draws.random(), chosen)
        for rows in (self.states, self.past.T, self.level, self.force_N, self.brisk):
            rows[:] = rows[chosen]
        self.weights[:] = 1 / self.count
        copies = np.flatnonzero(chosen == self.leader)
        self.leader = int(copies[0]) if copies.size else -1

    def survey(self) -> tuple[Array, float, float] | None:
        """The state (n,) of one particle that stands for all, at the mean position, the mean level and the mean force;
        fills `mean` and `std` (n,). None where the particles are no longer made of numbers.

        One particle sticks and slips as a capsule does, which no mean does. It leads until it is given up, or is far
        off the mean; then the one nearest to the mean takes over.
        """
        level, force = survey(self.weights, self.states, self.level, self.force_N, self.mean, self.std)
        if not math.isfinite(self.mean.sum() + self.std.sum() + level + force):
            return None
        self.leader = led(
            self.weights, self.states, self.level, self._wall, self.mean, self.std, level, _LEADS, self.leader
        )
        state: Array = self.states[self.leader].copy()
        state[0] = self.mean[0]
        self.std[self._modes] = 0.0
        return state, level, force


class ParticleEstimator(Estimator):
    """A particle filter with the control model as its process (`ParticleCloud`).

    The position is the mean of all, wall, slip and drive are those of one particle that leads. A coil's current is the
    same for all: its reading moves every particle by what it differs from their mean, as it was when it was read.
    `count`: with 150 a coil's capsule was lost for a moment over folds in two of eight runs, with 300 in none; behind a
    magnet 100 do as well.
    """

    def __init__(self, model: ControlModel, noise: FilterNoise | None = None, *, count: int = 300) -> None:
        super().__init__(model, noise)
        self._cloud = ParticleCloud(model, self.noise, self._kept, count)
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

    def _shift(self, back: int, position_m: float) -> None:
        self._cloud.shift(back, position_m)

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

    def _fuse(self, back: int, m: Measurement) -> float:
        if m.channel == "position_m":
            return self._cloud.see_position(back, m.value)
        off = m.value - self._currents[(self._cloud.newest - back) % self._kept]
        self._cloud.states[:, self._current] += off
        self._currents += off
        return 0.0

    def _estimate(self, now: float) -> Estimate | None:
        cloud = self._cloud
        found = cloud.survey()
        if found is None:
            return None
        state, level, force = found
        lacking, adapted = cloud.where.adapted(state, cloud.time_s, level, force)
        return Estimate(
            now,
            state,
            cloud.std.copy(),
            lacking,
            self._watch.lost(now, float(cloud.std[0])),
            adapted,
            tuple(self._innovations),
            self._surprise,
        )
