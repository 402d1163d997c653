"""PID and LQR, the classical controllers to compare with."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from controller.drives import Actuator, driven_of
from controller.limits import Envelope, number
from controller.model.control_model import ControlModel
from controller.model.linear import Linear, linearise
from controller.signals import Action, Array, Controller, Estimate, Reference
from controller.tuned import PidGains, check_numbers
from models.parameter import Name

_SPEED_M_S: Final = 5e-4  # of the feedforward's tanh


class PID(Controller):
    """PID on the position with a friction feedforward `F tanh(v_r/v_s)`; the command by the drive's static inverse."""

    def __init__(
        self, model: ControlModel, envelope: Envelope, gains: PidGains | None = None, friction_N: float = 0.0
    ) -> None:
        self.name = "pid" if friction_N == 0 else "pid_friction"
        self.gains = driven_of(model.drive).pid_estimated if gains is None else gains
        self._actuator, self._tick = Actuator(model.drive, model.theta.base, envelope), model.tick_s
        self._friction, self._sum, self._start = friction_N, 0.0, math.nan

    def reset(self, now: float, estimate: Estimate, command: float) -> None:
        """The integral starts so that the first answer repeats `command`."""
        self._sum, self._start = 0.0, number(command)

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Action:
        t = np.array([now])
        r, rate = number(reference.position(t)[0]), number(reference.speed(t)[0])
        x, v = number(estimate.state[0]), number(estimate.state[1])
        error, g = r - x, self.gains
        free = g.k_p * error + g.k_d * (rate - v) + self._friction * math.tanh(rate / _SPEED_M_S)
        if not math.isfinite(free):
            return Action(math.nan, "failed")
        if math.isfinite(self._start):
            self._sum = self._held(self._actuator.force(self._start, x, v) - free)
            self._start = math.nan
        self._sum = self._held(self._sum + g.k_i * error * self._tick)
        return Action(self._actuator.command(free + self._sum, x, v))

    def _held(self, value: float) -> float:
        return min(max(value, -self.gains.windup_N), self.gains.windup_N)


@dataclass(frozen=True)
class LqrWeights:
    """Deviations that the LQR weighs equally (Bryson): position, speed, integral of position, and the command beyond
    the reference's own (a gap in m, a current in A), each by its inverse square.
    """

    command: float
    position_m: float = 2e-4
    speed_m_s: float = 2e-2
    integral_m_s: float = 2e-5

    def __post_init__(self) -> None:
        check_numbers(self, "weight", positive=True)


@dataclass(frozen=True)
class Gains:
    """`u = N_u r - K (z - N_z r) - K_i i`, `i+ = i + tick (x - r)`, K (n,)."""

    states: tuple[Name, ...]
    tick_s: float
    K: Array
    K_i: float
    N_z: Array
    N_u: float


def augmented(plant: Linear) -> tuple[Array, Array]:
    """The plant with the integral of position as its last state."""
    n = len(plant.states)
    A = np.block([[plant.A, np.zeros((n, 1))], [plant.tick_s * np.eye(1, n), np.ones((1, 1))]])
    return A, np.vstack([plant.B, [[0.0]]])


def lqr_gains(plant: Linear, weights: LqrWeights | None = None) -> Gains:
    """The gains of the least `sum (x/position_m)^2 + (v/speed_m_s)^2 + (i/integral_m_s)^2 + (u/command)^2`."""
    import control  # it imports matplotlib, which takes a second

    if weights is None:  # a command that moves the capsule by 0.2 mm at 20 1/s is large
        moved = plant.response(np.exp(1j * np.array([20.0 * plant.tick_s])))[0, 0]
        weights = LqrWeights(2e-4 / float(np.abs(moved)))
    A, B = augmented(plant)
    Q = np.diag(
        [weights.position_m**-2, weights.speed_m_s**-2, *[0.0] * (len(plant.states) - 2), weights.integral_m_s**-2]
    )
    gain = np.asarray(control.dlqr(A, B, Q, [[weights.command**-2]])[0], dtype=float).ravel()
    N_z, N_u = plant.holding()
    return Gains(plant.states, plant.tick_s, gain[:-1], float(gain[-1]), N_z, N_u)


class LQR(Controller):
    """LQR with integral action on the estimate, without stick and slip; at the ends of the range the integral stops."""

    name = "lqr"

    def __init__(self, model: ControlModel, envelope: Envelope, gains: Gains | None = None) -> None:
        self.gains = lqr_gains(linearise(model, "slip")) if gains is None else gains
        self._pick = np.array([model.index(name) for name in self.gains.states])
        self._low, self._high = envelope.low, envelope.high
        self._gap = envelope.gap_m if envelope.placed else math.inf
        self._sum = 0.0
        self._start: float | None = None

    def reset(self, now: float, estimate: Estimate, command: float) -> None:
        """The first answer repeats `command`."""
        self._sum, self._start = 0.0, number(command)

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Action:
        t = np.array([now])
        r, speed = number(reference.position(t)[0]), number(reference.speed(t)[0])
        g = self.gains
        error = np.asarray(estimate.state, dtype=float)[self._pick] - g.N_z * r
        error[1] -= speed
        free = g.N_u * r - float(g.K @ error)
        x = number(estimate.state[self._pick[0]])
        if not math.isfinite(free + x):
            return Action(math.nan, "failed")
        if self._start is not None:
            self._sum, self._start = ((free - self._start) / g.K_i if math.isfinite(self._start) else 0.0), None
            return Action(free - g.K_i * self._sum)
        low, high = max(self._low, x - self._gap), min(self._high, x + self._gap)
        wanted = self._sum + g.tick_s * (x - r)
        command = free - g.K_i * wanted
        if low <= command <= high or (command - low) * (x - r) * g.K_i > 0:
            self._sum = wanted
        return Action(min(max(free - g.K_i * self._sum, low), high))
