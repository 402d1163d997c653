"""A Kalman filter by cubature points, compiled: late measurements are used where they belong, later ticks again."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar, Final

import casadi as ca
import numpy as np

from controller.estimator import base
from controller.estimator.kernels import place_points, take_moments
from controller.model.control_model import ControlModel
from controller.signals import Array, Measurement
from controller.tuned import FilterNoise
from models.parameter import Name
from models.theta import bare

# of states in their unit, before any measurement
_START_STD: Final = {**base.START_STD, "current_A": 0.1, "stretch_m": 1e-4, "rate_m_s": 1e-2}


@dataclass(slots=True)
class Belief:
    """`z` (n,): continuous states in the model's order, disturbance and friction level, `P` (n, n) their covariance,
    `modes` a model state with valid switches. `time_s`, the `command` in force up to then, and the mean normalised
    innovation of recent positions, `surprise`.
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


def fuse(z: Array, P: Array, H: Array, difference: float, R: float, gate: float) -> float:
    """Use, in place, `difference` = measured - expected with slopes `H` (n,) and variance `R`; returns the normalised
    `|difference|/sqrt(H P H' + R)`. Beyond `gate`, or not a number, nothing changes. Joseph's form.
    """
    with np.errstate(all="ignore"):  # of numbers that are none
        K = P @ H
        S = float(H @ K) + R
        size = abs(difference) / math.sqrt(S) if S > 0 else math.inf
        if size <= gate:
            K /= S
            z += K * difference
            rest = np.eye(z.size) - np.outer(K, H)
            P[:] = rest @ P @ rest.T + R * np.outer(K, K)
            P[:] = 0.5 * (P + P.T)
    return size


class Process:
    """The control model as a filter's process `z+ = f(z, command) + w`, by cubature points."""

    def __init__(self, model: ControlModel, noise: FilterNoise) -> None:
        self.model, self.noise, self.level = model, noise, base.Level(model)
        self.where = np.array([k for k, name in enumerate(model.states) if name not in model.modes], dtype=np.int64)
        self.names = (*(model.states[k] for k in self.where), "disturbance", "level")
        walks = [*map(noise.wander, self.names[:-2]), noise.force_wander_N, noise.level_wander]
        self._walk = np.array(walks) ** 2 * model.tick_s
        x, t = ca.SX.sym("x", len(model.states)), ca.SX.sym("t")
        shown = model.measured(x, t)
        self._seen = ca.Function("seen", [x, t], [shown, ca.gradient(shown, x)])
        n = len(self.names)
        self._scale, self._which = math.sqrt(n), np.array([self.level.index])
        self._bounds = np.array([self.level.low, self.level.high, self.level.middle])
        self._states = np.zeros((2 * n + 1, len(model.states)))
        self._d, self._level, self._values = (np.zeros(2 * n + 1) for _ in range(3))
        self._L, self._H = np.zeros((n, n)), np.zeros(n)

    def start(self, position_m: float, std_m: float, command: float, now: float) -> Belief:
        """At rest at `position_m`, known to `std_m`, after a long time under `command`."""
        state = self.model.initial(position_m, command)
        spread = [_START_STD.get(bare(name), 1e-3) for name in self.names[1:-2]]
        spread = [std_m, *spread, self.noise.force_std_N, self.noise.level_std]
        return Belief(np.append(state[self.where], [0.0, 0.0]), np.diag(np.square(spread)), state.copy(), now, command)

    def predict(self, b: Belief, command: float) -> None:
        """Advance `b` by a tick in place, at the end of which the drive is at `command`."""
        force, place = self.noise.walks(b.surprise)
        self._walk[-2], self._walk[0] = force**2 * self.model.tick_s, place**2 * self.model.tick_s
        self._move(b, self.model.command_from(b.command, command), command)
        b.time_s += self.model.tick_s
        b.command = command

    def _move(self, b: Belief, before: float, command: float) -> None:
        k, points = self.model.kernels, (self._states, self._d, self._level)
        place_points(b.z, b.P, b.modes, self.where, self._scale, self._bounds, self._L, *points, self._values)
        moved = (self._states, before, command, self._d, b.time_s, k.tick_s, k.substeps, k.parameters)
        k.run_each(self._which, self._values[None, :], *moved)
        take_moments(*points, self.where, self._scale, self._walk, b.z, b.P, b.modes)

    def shown(self, b: Belief) -> float:
        """The reading of the localisation in m at `b`."""
        return float(b.z[0] if self.model.placed else self._seen(self.state(b), b.time_s)[0])

    def see(self, b: Belief, value: float, state: Name | None = None) -> float:
        """Use a localisation, or a reading of the `state`, in place; its signed normalised innovation."""
        std = self.noise.position_std_m if state is None else self.noise.feedback_std
        size = self._use(b, value, std**2, None if state is None else self.names.index(state))
        if state is None and abs(size) <= self.noise.gate:
            b.surprise = self.noise.surprised(b.surprise, size)
        return size

    def _use(self, b: Belief, value: float, variance: float, row: int | None) -> float:
        """Use `value` of the localisation (None) or of a `row` of z; its innovation, beyond the gate if refused."""
        self._H[:] = 0.0
        self._H[row or 0] = 1.0
        expected = float(b.z[row or 0])
        if row is None and not self.model.placed:
            shown, slopes = self._seen(self.state(b), b.time_s)
            expected = float(shown)
            self._H[:-2] = np.asarray(slopes).ravel()[self.where]
        off = value - expected
        return math.copysign(fuse(b.z, b.P, self._H, off, variance, self.noise.gate), off)

    def state(self, b: Belief) -> Array:
        state = b.modes.copy()
        state[self.where] = b.z[:-2]
        return state


@dataclass(slots=True)
class _Tick:
    belief: Belief
    seen: list[Measurement] = field(default_factory=list)


class CubatureEstimator(base.Estimator):
    """A Kalman filter with the control model as its `process`. After a late measurement the ticks since are computed
    again, a bounded number. Some of its points stick while others slip, so the mean glides where the capsule jumps.
    """

    process: ClassVar[type[Process]] = Process

    def __init__(self, model: ControlModel, noise: FilterNoise | None = None) -> None:
        super().__init__(model, noise)
        self._process = self.process(model, self.noise)
        self._ticks = [_Tick(self._process.start(0.0, 1.0, 0.0, 0.0)) for _ in range(self._kept)]
        self._newest = 0
        self.reset(0.0, 0.0)

    def _at(self, back: int) -> _Tick:
        return self._ticks[(self._newest - back) % self._kept]

    def _begin(self, position_m: float, now: float) -> None:
        tick = self._at(0)
        tick.belief.copy_from(self._process.start(position_m, self.noise.position_std_m, self._command, now))
        tick.seen.clear()

    def _shift(self, back: int, position_m: float) -> None:
        off = position_m - self._process.shown(self._at(back).belief)
        for k in range(back + 1):
            belief = self._at(k).belief
            belief.z[0] += off
            belief.P[0, 0] += self.noise.position_std_m**2

    def _predict(self, now: float, command: float) -> None:
        self._newest += 1
        self._at(0).seen.clear()
        self._redone(0, now, command)

    def _fuse(self, back: int, m: Measurement) -> float:
        size = self._see(self._at(back).belief, m)
        if abs(size) <= self.noise.gate:
            self._at(back).seen.append(m)
            for k in range(back - 1, -1, -1):
                belief = self._at(k).belief
                self._redone(k, belief.time_s, belief.command)
        return size

    def _redone(self, back: int, time_s: float, command: float) -> None:
        """The estimate `back` ticks ago from the one before, with all measurements of that tick."""
        tick = self._at(back)
        tick.belief.copy_from(self._at(back + 1).belief)
        self._process.predict(tick.belief, command)
        tick.belief.time_s = time_s
        for m in tick.seen:
            self._see(tick.belief, m)

    def _see(self, belief: Belief, m: Measurement) -> float:
        state = None if m.channel == "position_m" else self.model.states[self._current or 0]
        return self._process.see(belief, m.value, state)

    def _estimate(self) -> tuple[Array, Array, float, float] | None:
        b, process = self._at(0).belief, self._process
        if not math.isfinite(b.z.sum() + b.P.sum()):
            return None
        std = np.zeros(len(self.model.states))
        std[process.where] = np.sqrt(np.maximum(b.P.diagonal()[:-2], 0.0))
        return process.state(b), std, float(b.z[-1]), float(b.z[-2])
