"""Fair baselines: PID and LQR with the strongest integral in stick and slip with delay, and their loops' margins."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TypeVar

import control
import numpy as np
from numpy.typing import NDArray

from controller.baselines import Gains, LqrWeights, augmented, lqr_gains
from controller.model.linear import Linear
from controller.signals import Array

Complex = NDArray[np.complex128]
_POINTS = 4000  # frequencies up to half the sampling rate


@dataclass(frozen=True)
class Margins:
    """`gain` (factor), `phase_deg`, `delay_s` beyond the present one, `sensitivity_peak` max |1/(1 + L)|,
    `crossover_Hz` of |L| = 1, `bandwidth_Hz` at which the closed loop has fallen by 3 dB, `stable` by the poles. Inf or
    NaN without such a crossing.
    """

    gain: float
    phase_deg: float
    delay_s: float
    sensitivity_peak: float
    crossover_Hz: float
    bandwidth_Hz: float
    stable: bool


@dataclass(frozen=True)
class OpenLoop:
    """An open loop `L` (discrete, broken at the plant's command), poles (k,) of the closed one, with `delay_s`."""

    name: str
    phase: str
    tick_s: float
    delay_s: float
    omega: Array
    L: Complex
    poles: Complex

    def margins(self) -> Margins:
        frd = control.frd(self.L, self.omega, smooth=True)
        gain, phase, least, _, crossover, _ = control.stability_margins(frd)
        T = np.abs(self.L / (1 + self.L))
        fallen = np.flatnonzero(T[0] / math.sqrt(2) > T)
        band = self.omega[fallen[0]] / (2 * math.pi) if fallen.size else math.nan
        delay = math.radians(float(phase)) / float(crossover) if np.isfinite(phase) and crossover > 0 else math.inf
        peak = 1 / float(least) if least and np.isfinite(least) else 1.0
        return Margins(
            float(gain), float(phase), delay, peak, float(crossover) / (2 * math.pi), float(band), self.stable()
        )

    def stable(self) -> bool:
        return bool(np.all(np.abs(self.poles) < 1))

    def sensitivity(self) -> Array:
        """`|1/(1 + L)|` over `omega`."""
        return np.asarray(np.abs(1 / (1 + self.L)))


def closed_loop(name: str, plant: Linear, open_loop: control.StateSpace, delay_s: float) -> OpenLoop:
    """Frequency response with the exact delay; poles with the delay in whole ticks, rounded up."""
    h = plant.tick_s
    omega = np.geomspace(0.02, 0.999 * math.pi / h, _POINTS)
    L = np.asarray(open_loop(np.exp(1j * omega * h))).ravel() * np.exp(-1j * omega * delay_s)
    late = math.ceil(delay_s / h - 1e-9)
    whole = open_loop if late == 0 else control.series(open_loop, _held_back(late, h))
    closed = whole.A - whole.B @ whole.C / (1 + float(np.squeeze(whole.D)))
    return OpenLoop(name, plant.phase, h, delay_s, omega, L, np.linalg.eigvals(closed).astype(complex))


def _held_back(ticks: int, h: float) -> control.StateSpace:
    """A delay of whole ticks."""
    A, C = np.eye(ticks, k=-1), np.zeros((1, ticks))
    C[0, -1] = 1.0
    return control.ss(A, np.eye(ticks, 1), C, 0.0, h)


FILTER_S = 5e-3  # s, of the PID's derivative
PEAK = 1.6  # greatest sensitivity: the loop stays 1/1.6 away from -1
_STEPS = 24  # gains on a logarithmic axis
_TIMES = 6  # time constants of the integral


@dataclass(frozen=True)
class Pid:
    """`u = K_p e + K_i sum e dt + K_d (e - w)/filter_s` on the error e in m with w the error after a first-order lag
    `filter_s`; u in the command's unit. A magnet's carriage adds the reference's position.
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


Law = TypeVar("Law", Pid, Gains)


def feedback(plant: Linear, law: Pid | Gains, z: Complex) -> Complex:
    """The controller's share of each state, (n, k) at the points `z`; the command is minus their sum."""
    n, first = len(plant.states), np.eye(len(plant.states))[:, :1]
    if isinstance(law, Pid):
        return np.asarray(first * law.response(z, plant.tick_s))
    return np.asarray(law.K.reshape(n, 1) + first * law.K_i * plant.tick_s / (z - 1))


def pid_loop(plant: Linear, pid: Pid, delay_s: float) -> OpenLoop:
    """PID on the position, measured `delay_s` late."""
    return closed_loop("pid", plant, control.series(pid.system(plant.tick_s), plant.system()), delay_s)


def state_loop(plant: Linear, gains: Gains, delay_s: float) -> OpenLoop:
    """State feedback with integral, states `delay_s` old: without an estimator that predicts across the delay."""
    A, B = augmented(plant)
    open_loop = control.ss(A, B, np.r_[gains.K, gains.K_i][None, :], 0.0, plant.tick_s)
    return closed_loop("lqr", plant, open_loop, delay_s)


def tuned_pid(plants: Sequence[Linear], delay_s: float, peak: float = PEAK) -> Pid:
    """The PID with the largest `K_i`, which overcomes unknown friction, with a sensitivity peak of at most `peak` on
    all of `plants` (Astrom and Hagglund's M-constrained integral gain optimisation, on a grid). Raises ValueError if
    none of the grid fits.
    """
    sizes, rates, leads = np.geomspace(1e-2, 1e2, _STEPS), np.geomspace(0.3, 300, _STEPS), (0.0, 5e-3, 1e-2, 2e-2)
    gains = product(_scale(plants) * sizes, rates, leads)
    pids = [Pid(float(K_p), float(K_p * rate), float(K_p * lead)) for K_p, rate, lead in gains]
    return _strongest("PID", pids, pid_loop, plants, delay_s, peak)


def tuned_lqr(plants: Sequence[Linear], design: Linear, delay_s: float, peak: float = PEAK) -> Gains:
    """The LQR for `design` with the largest `K_i` and a sensitivity peak of at most `peak` on every one of `plants`;
    see `tuned_pid`. Weights of command and integral vary, the position's is 0.2 mm, the speed's 20 mm/s.
    """
    commands = 2e-4 * _scale(plants) * np.geomspace(0.1, 10, _STEPS // 2)
    times = np.geomspace(0.02, 1.0, _TIMES)
    choices = [lqr_gains(design, LqrWeights(float(c), integral_m_s=2e-4 * T)) for c, T in product(commands, times)]
    return _strongest("LQR", choices, state_loop, plants, delay_s, peak)


def _scale(plants: Sequence[Linear]) -> float:
    """Command per distance at 20 1/s, on the plant that moves farthest."""
    omega, z = _points(plants[0].tick_s)
    return 1 / max(float(np.interp(20.0, omega, np.abs(plant.response(z)[0]))) for plant in plants)


def _points(tick_s: float) -> tuple[Array, Complex]:
    """Frequencies in 1/s, and their points on the unit circle."""
    omega = np.geomspace(0.1, 0.99 * math.pi / tick_s, 300)
    return omega, np.exp(1j * omega * tick_s)


def _strongest(
    name: str,
    laws: Iterable[Law],
    loop: Callable[[Linear, Law, float], OpenLoop],
    plants: Sequence[Linear],
    delay_s: float,
    peak: float,
) -> Law:
    """The one of `laws` with the largest `K_i` that is stable on all of `plants`, no sensitivity above `peak`."""
    omega, z = _points(plants[0].tick_s)
    late, states = np.exp(-1j * omega * delay_s), [plant.response(z) for plant in plants]
    for law in sorted(laws, key=lambda law: -law.K_i):
        pairs = zip(plants, states, strict=True)
        peaks = (_peak(late * np.sum(feedback(plant, law, z) * X, axis=0)) for plant, X in pairs)
        if all(one <= peak for one in peaks) and all(loop(plant, law, delay_s).stable() for plant in plants):
            return law
    raise ValueError(f"sensitivity peak must be within reach of a {name} on this plant; got {peak:g}")


def _peak(L: Complex) -> float:
    """The highest sensitivity of an open loop; inf if it crosses |L| = 1 more than once or too late."""
    above = np.abs(L) > 1
    crossings = np.flatnonzero(above[1:] != above[:-1])
    # an unwrapped phase starts between -270 and 90 degrees, where loops with integrals start
    turns = 2 * math.pi if np.angle(L[0]) > 0.5 * math.pi else 0.0
    if len(crossings) != 1 or np.unwrap(np.angle(L))[crossings[0]] - turns < -math.pi:
        return math.inf
    return float(np.max(1 / np.abs(1 + L)))
