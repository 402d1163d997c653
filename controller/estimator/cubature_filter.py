"""The Gaussian estimator: beliefs kept for a while, so that a late measurement is taken in where it belongs and what
came after is redone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar, Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from controller.estimator.base import Estimator
from controller.estimator.cubature_kernels import fuse, place_points, take_moments, take_spread
from controller.estimator.friction_scale import Level
from controller.estimator.noise import START_STD
from controller.model.control_model import ControlModel
from controller.signals import Adapted, Estimate, Measurement
from controller.tuned import FilterNoise
from models.parameter import Name
from models.theta import bare

Array = NDArray[np.float64]
# of states in their unit, before anything was measured
_START_STD: Final = {**START_STD, "current_A": 0.1, "stretch_m": 1e-4, "rate_m_s": 1e-2}


@dataclass(slots=True)
class Belief:
    """`z` (n,) the continuous states in the model's order, the disturbance and the friction level, `P` (n, n) their
    covariance, `modes` a model state whose switches count; `time_s`, the `command` in force up to then, and by how many
    standard deviations recent positions were off on average, `surprise`.
    """

    z: Array
    P: Array
    modes: Array
    time_s: float = 0.0
    command: float = 0.0
    surprise: float = 0.0

    def copy_from(self, other: Belief) -> None:
        """Become `other` without a new array."""
        self.z[:], self.P[:], self.modes[:] = other.z, other.P, other.modes
        self.time_s, self.command, self.surprise = other.time_s, other.command, other.surprise


@dataclass
class Process:
    """The control model as a filter's process: `z+ = f(z, command) + w`.

    `measured` of the model is linear in `x` alone unless effects of the
    sensor say otherwise; then its slopes come from CasADi.
    """

    model: ControlModel
    noise: FilterNoise
    where: NDArray[np.int64] = field(init=False)
    wander: Array = field(init=False)

    def __post_init__(self) -> None:
        model = self.model
        self.where = np.array([k for k, name in enumerate(model.states) if name not in model.modes], dtype=np.int64)
        self.names = (*(model.states[k] for k in self.where), "disturbance", "level")
        n = len(self.names)
        walks = [self.noise.wander(name) for name in self.names[:-2]] + [
            self.noise.force_wander_N,
            self.noise.level_wander,
        ]
        self.wander = np.array(walks) ** 2 * model.tick_s
        self._walk = self.wander.copy()
        self._scale = math.sqrt(n)
        self._states, self._d, self._level = (
            np.zeros((2 * n + 1, len(model.states))),
            np.zeros(2 * n + 1),
            np.zeros(2 * n + 1),
        )
        self.level = Level(model)
        self._bounds = np.array([self.level.low, self.level.high, self.level.middle])
        self._values = np.zeros(2 * n + 1)
        self._points = (self._states, self._d, self._level, self._values)
        self._L, self._K, self._H = np.zeros((n, n)), np.zeros(n), np.zeros(n)
        self._kernels = model.kernels
        x, t = ca.SX.sym("x", len(model.states)), ca.SX.sym("t")
        shown = model.measured(x, t)
        self._plain = bool(ca.is_equal(ca.simplify(shown), x[0], 2))
        self._seen = ca.Function("seen", [x, t], [shown, ca.gradient(shown, x)])

    @property
    def size(self) -> int:
        """Number of filtered states, disturbance and level included."""
        return len(self.names)

    def start(self, position_m: float, std_m: float, command: float, now: float) -> Belief:
        """At rest at `position_m`, known to `std_m`, with `command` in force for long."""
        state = self.model.initial(position_m, command)
        spread = [_START_STD.get(bare(name), 1e-3) for name in self.names[:-2]]
        spread = [std_m, *spread[1:], self.noise.force_std_N, self.noise.level_std]
        return Belief(np.append(state[self.where], [0.0, 0.0]), np.diag(np.square(spread)), state.copy(), now, command)

    def predict(self, b: Belief, command: float) -> None:
        """Move `b` a tick on in place, to the end of which `command` leads; a carriage goes there in a straight
        line.
        """
        place_points(b.z, b.P, b.modes, self.where, self._scale, self._bounds, self._L, *self._points)
        k = self._kernels
        before = self.model.left(b.command, command)
        own = (k.parameters, self.level.index, self._values)
        k.run_each(self._states, before, command, self._d, b.time_s, k.tick_s, k.substeps, *own)
        walk = self._noise_of(b)
        take_moments(self._states, self._d, self._level, self.where, self._scale, walk, b.z, b.P, b.modes)
        b.time_s += k.tick_s
        b.command = command

    def _noise_of(self, b: Belief) -> Array:
        """Variances (n,) that a tick adds to `b`."""
        force, place = self.noise.walks(b.surprise)
        self._walk[-2], self._walk[0] = force**2 * self.model.tick_s, place**2 * self.model.tick_s
        return self._walk

    def move(self, z: Array, modes: Array, before: float, command: float, t: float) -> tuple[Array, Array]:
        """One point `z` (n,) with the switches `modes` (model states,) a tick on that `command` ends: both anew."""
        state = modes.copy()
        state[self.where] = z[:-2]
        numbers = self.level.numbers(z[-1])
        k = self._kernels
        states = state.reshape(1, -1)
        before = self.model.left(before, command)
        k.run(states, before, command, np.array([z[-2]]), t, k.tick_s, k.substeps, numbers)
        return np.append(states[0, self.where], z[-2:]), states[0]

    def shown(self, b: Belief) -> float:
        """What localisation reads of `b`, in m."""
        return float(b.z[0] if self._plain else self._seen(self.state(b), b.time_s)[0])

    def see_position(self, b: Belief, value: float) -> float:
        """Take in a localisation in place; returns its normalised difference, signed, beyond the gate where it was
        refused.
        """
        self._H[:] = 0.0
        expected = b.z[0]
        if self._plain:
            self._H[0] = 1.0
        else:
            shown, slopes = self._seen(self.state(b), b.time_s)
            expected = float(shown)
            self._H[:-2] = np.asarray(slopes).ravel()[self.where]
        size = float(fuse(b.z, b.P, self._H, value - expected, self.noise.position_std_m**2, self.noise.gate, self._K))
        size = math.copysign(size, value - expected)
        if abs(size) <= self.noise.gate:
            b.surprise = self.noise.surprised(b.surprise, size)
        return size

    def see_state(self, b: Belief, name: Name, value: float) -> float:
        """Take in a reading of the state `name` itself, such as a coil's current."""
        self._H[:] = 0.0
        place = self.names.index(name)
        self._H[place] = 1.0
        return float(fuse(b.z, b.P, self._H, value - b.z[place], self.noise.feedback_std**2, self.noise.gate, self._K))

    def state(self, b: Belief) -> Array:
        """`b` as a state (n,) of the model."""
        state = b.modes.copy()
        state[self.where] = b.z[:-2]
        return state

    def adapted(self, b: Belief) -> tuple[float, Adapted]:
        """The force that the model's own parameters lack, and those with the level of `b` (`Level.adapted`)."""
        return self.level.adapted(self.state(b), b.time_s, float(b.z[-1]), float(b.z[-2]))

    def spread(self, b: Belief) -> tuple[Array, bool]:
        """Standard deviations (n,) in the model's order, 0 for switches; whether `b` is made of numbers."""
        std = np.zeros(len(self.model.states))
        return std, take_spread(b.z, b.P, self.where, std)


@dataclass(slots=True)
class _Tick:
    """A tick that is kept: the belief at its end with all that was measured there, and what the drive was told."""

    belief: Belief
    told: float = 0.0
    seen: list[Measurement] = field(default_factory=list)


class CubatureEstimator(Estimator):
    """A cubature Kalman filter with the control model as its process.

    A late measurement is taken in at the tick of its stamp and the ticks since are computed again: their number, and so
    the time this takes, is bounded. Its points lie a standard deviation away, some stick while others slip: the mean
    glides where the capsule jumps.
    """

    process: ClassVar[type[Process]] = Process

    def __init__(self, model: ControlModel, noise: FilterNoise | None = None) -> None:
        super().__init__(model, noise)
        self._process = self.process(model, self.noise)
        self._ticks = [_Tick(self._process.start(0.0, 1.0, 0.0, 0.0)) for _ in range(self._kept)]
        self._newest = 0
        self.reset(0.0, 0.0)

    def _at(self, back: int) -> _Tick:
        return self._ticks[(self._newest - back) % len(self._ticks)]

    def _begin(self, position_m: float, now: float) -> None:
        start = self._process.start(position_m, self.noise.position_std_m, self._command, now)
        self._at(0).belief.copy_from(start)
        self._at(0).told = self._command
        self._at(0).seen.clear()

    def _shift(self, back: int, position_m: float) -> None:
        off = position_m - self._process.shown(self._at(back).belief)
        for k in range(back + 1):
            belief = self._at(k).belief
            belief.z[0] += off
            belief.P[0, 0] += self.noise.position_std_m**2

    def _go_on(self, now: float, command: float) -> None:
        last = self._at(0).belief
        self._newest += 1
        tick = self._at(0)
        tick.belief.copy_from(last)
        tick.seen.clear()
        self._process.predict(tick.belief, command + self._offset)
        tick.belief.time_s = now
        tick.told = command

    def _told(self, back: int) -> float:
        return self._at(back).told

    def _fuse(self, back: int, m: Measurement) -> float:
        size = self._see(self._at(back).belief, m)
        if abs(size) <= self.noise.gate:
            self._at(back).seen.append(m)
            self._redo(back)
        return size

    def _see(self, belief: Belief, m: Measurement) -> float:
        if m.channel == "position_m":
            return self._process.see_position(belief, m.value)
        return self._process.see_state(belief, self.model.states[self._current or 0], m.value)

    def _redo(self, back: int) -> None:
        """Compute the ticks since `back` ticks ago again, with all that was measured in them."""
        for k in range(back, 0, -1):
            tick = self._at(k - 1)
            time_s, command = tick.belief.time_s, tick.belief.command
            tick.belief.copy_from(self._at(k).belief)
            self._process.predict(tick.belief, command)
            tick.belief.time_s = time_s
            for m in tick.seen:
                self._see(tick.belief, m)

    def _estimate(self, now: float) -> Estimate | None:
        belief, process = self._at(0).belief, self._process
        std, sound = process.spread(belief)
        if not sound:
            return None
        force, adapted = process.adapted(belief)
        return Estimate(
            now,
            process.state(belief),
            std,
            force,
            self._watch.lost(now, float(std[0])),
            adapted,
            tuple(self._innovations),
            self._surprise,
        )
