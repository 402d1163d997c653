"""PID on the position, and PID with a friction feedforward `F tanh(v_r/v_s)`: they know little of the wall."""

import math
from typing import Final

import numpy as np

from controller.drives import Actuator, driven_of
from controller.limits import Envelope, number
from controller.model.control_model import ControlModel
from controller.signals import Action, Controller, Estimate, Reference
from controller.tuned import PidGains

_SPEED_M_S: Final = 5e-4  # of the feedforward's tanh


class PID(Controller):
    """Force from the error, command from the force by the drive's static inverse. `friction_N` 0: no feedforward."""

    def __init__(
        self,
        model: ControlModel,
        envelope: Envelope,
        gains: PidGains | None = None,
        friction_N: float = 0.0,
    ) -> None:
        self.name = "pid" if friction_N == 0 else "pid_friction"
        self.gains = driven_of(model.drive).pid_estimated if gains is None else gains
        self._actuator, self._tick = Actuator(model.drive, model.theta.base, envelope), model.tick_s
        self._friction, self._sum, self._start = friction_N, 0.0, math.nan

    def reset(self, now: float, estimate: Estimate, command: float) -> None:
        """Begin with `command` in force: the integral starts at what makes the first answer repeat it."""
        self._sum, self._start = 0.0, number(command)

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Action:
        """The command for the tick that begins at `now` in s; `failed` where estimate or reference is no number."""
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
