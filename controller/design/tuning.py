"""Fair baselines: the PID and the LQR with the strongest integral that the plant bears, stuck and slipping, at the
delay there is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product

import control
import numpy as np

from controller.baselines.lqr import Gains, LqrWeights, augmented, lqr_gains
from controller.design.margins import Complex, OpenLoop, closed_loop
from controller.model.linear import Array, Linear

FILTER_S = 5e-3  # s, of the PID's derivative
PEAK = 1.6  # most that the sensitivity may rise to: the loop stays 1/1.6 off -1
_STEPS = 24  # gains that are tried on a logarithmic axis
_TIMES = 6  # times of the integral that are tried


@dataclass(frozen=True)
class Pid:
    """`u = K_p e + K_i sum e dt + K_d (e - w)/filter_s` on the error e in m with w the error behind a first-order lag
    `filter_s`; u in the command's unit. A magnet's carriage moves with the reference beside it.
    """

    K_p: float
    K_i: float
    K_d: float
    filter_s: float = FILTER_S

    def system(self, tick_s: float) -> control.StateSpace:
        """From error to command, discrete in time."""
        left, slope = math.exp(-tick_s / self.filter_s), self.K_d / self.filter_s
        A, B = np.diag([1.0, left]), np.array([[tick_s], [1 - left]])
        return control.ss(A, B, np.array([[self.K_i, -slope]]), self.K_p + slope, tick_s)

    def response(self, z: Complex, tick_s: float) -> Complex:
        """The same at the points `z`."""
        left = math.exp(-tick_s / self.filter_s)
        return np.asarray(self.K_p + self.K_i * tick_s / (z - 1) + self.K_d / self.filter_s * (z - 1) / (z - left))


def pid_loop(plant: Linear, pid: Pid, delay_s: float) -> OpenLoop:
    """PID on the position, measured `delay_s` late."""
    return closed_loop("pid", plant, control.series(pid.system(plant.tick_s), plant.system()), delay_s)


def state_loop(plant: Linear, gains: Gains, delay_s: float) -> OpenLoop:
    """State feedback with integral, states `delay_s` old: what is left where no estimator predicts across the delay."""
    A, B = augmented(plant)
    open_loop = control.ss(A, B, np.r_[gains.K, gains.K_i][None, :], 0.0, plant.tick_s)
    return closed_loop("lqr", plant, open_loop, delay_s)


def tuned_pid(plants: Sequence[Linear], delay_s: float, peak: float = PEAK) -> Pid:
    """The PID with the largest `K_i` whose sensitivity peak is at most `peak` on every one of `plants`.

    The integral is what overcomes friction that the controller does not know, so its gain is what counts (Astrom and
    Hagglund's M-constrained integral gain optimisation, here on a grid). Raises ValueError for a peak of 1 or less, or
    where none of the grid fits.
    """
    grid = _Grid.of(plants, delay_s)
    scale = 1 / max(float(np.interp(20.0, grid.omega, np.abs(X[0]))) for X in grid.states)
    gains = product(scale * np.geomspace(1e-2, 1e2, _STEPS), np.geomspace(0.3, 300, _STEPS), (0.0, 5e-3, 1e-2, 2e-2))
    pids = [Pid(float(K_p), float(K_p * rate), float(K_p * lead)) for K_p, rate, lead in gains]
    pids.sort(key=lambda pid: -pid.K_i)
    for pid in pids:
        if grid.peak([pid.response(grid.z, grid.tick_s) * X[0] for X in grid.states]) <= peak and all(
            pid_loop(plant, pid, delay_s).stable() for plant in plants
        ):
            return pid
    raise ValueError(f"sensitivity peak must be one that some PID keeps on this plant; got {peak:g}")


def tuned_lqr(plants: Sequence[Linear], design: Linear, delay_s: float, peak: float = PEAK) -> Gains:
    """The LQR for `design` with the largest `K_i` whose sensitivity peak is at most `peak` on every one of `plants`;
    see `tuned_pid`.

    Weights of command and integral vary, the position's is 0.2 mm, the speed's 20 mm/s.
    """
    grid = _Grid.of(plants, delay_s)
    scale = 1 / max(float(np.interp(20.0, grid.omega, np.abs(X[0]))) for X in grid.states)
    commands, times = 2e-4 * scale * np.geomspace(0.1, 10, _STEPS // 2), np.geomspace(0.02, 1.0, _TIMES)
    choices = [lqr_gains(design, LqrWeights(float(c), integral_m_s=2e-4 * T)) for c, T in product(commands, times)]
    for gains in sorted(choices, key=lambda gains: -gains.K_i):
        loops = [gains.K @ X + gains.K_i * grid.tick_s / (grid.z - 1) * X[0] for X in grid.states]
        if grid.peak(loops) <= peak and all(state_loop(plant, gains, delay_s).stable() for plant in plants):
            return gains
    raise ValueError(f"sensitivity peak must be one that some LQR keeps on this plant; got {peak:g}")


@dataclass(frozen=True)
class _Grid:
    """Frequencies `omega` in 1/s, `z` on the unit circle, the delay's factor `late`, and each plant's states (n, k) for
    its command.
    """

    tick_s: float
    omega: Array
    z: Complex
    late: Complex
    states: tuple[Complex, ...]

    @classmethod
    def of(cls, plants: Sequence[Linear], delay_s: float) -> _Grid:
        """The responses of `plants`, all of one tick."""
        tick = plants[0].tick_s
        omega = np.geomspace(0.1, 0.99 * math.pi / tick, 300)
        z = np.exp(1j * omega * tick)
        return cls(tick, omega, z, np.exp(-1j * omega * delay_s), tuple(plant.response(z) for plant in plants))

    def peak(self, loops: Iterable[Complex]) -> float:
        """The highest sensitivity of the loops, each with the delay; inf where one crosses |L| = 1 more than once or
        too late.
        """
        return max(self._one_peak(L * self.late) for L in loops)

    def _one_peak(self, L: Complex) -> float:
        above = np.abs(L) > 1
        crossings = np.flatnonzero(above[1:] != above[:-1])
        if len(crossings) != 1 or np.unwrap(np.angle(L))[crossings[0]] - _turns(L) < -math.pi:
            return math.inf
        return float(np.max(1 / np.abs(1 + L)))


def _turns(L: Complex) -> float:
    """What to take off an unwrapped phase so that it starts between -270 and 90 degrees, where loops with integrals
    start.
    """
    start = float(np.angle(L[0]))
    return 2 * math.pi if start > 0.5 * math.pi else 0.0
