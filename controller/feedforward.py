"""Feedforward: the control model inverted along the reference, with a slow position loop."""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from controller.drives import driven_of
from controller.limits import Envelope, number
from controller.model.control_model import ControlModel
from controller.signals import Action, Array, Controller, Estimate, Reference
from controller.tuned import Correction

_EVALUATIONS: Final = 30  # of the model per command at most
_SHARE: Final = 1e-4  # accuracy of the command as a share of its range
_JUMP_S: Final = 1e-7  # step from the command in force to the tried one
_JUMP_STEPS: Final = 4  # integration steps of the jump


class Inverse:
    """`command(x, d, v)`: the command under which the model goes from the state `x` under the disturbance `d` to the
    speed `v` within `reach_s`.

    The model's own step is inverted with all its parts: stick, slip, inertia, the stable branch of a magnet, a coil's
    circuit, effects between command and force. If it remembers the carriage's path, as play does, the step starts with
    a jump from the command in force. The speed grows with the command, so a bracket closes on it (regula falsi,
    Illinois), in at most `_EVALUATIONS` steps of the model.
    """

    def __init__(self, model: ControlModel, envelope: Envelope, reach_s: float = 4e-3) -> None:
        self.model = replace(model.sharp, tick_s=reach_s)
        self._kernels, self._envelope = self.model.kernels, envelope
        self._parameters = self._kernels.parameters
        self._state = np.zeros((1, len(model.states)))
        self._d = np.zeros(1)
        self._remembers = remembers(model, envelope)
        self._before = math.nan

    def command(
        self,
        x: Array,
        disturbance_N: float,
        speed_m_s: float,
        t: float,
        parameters: Array | None = None,
        before: float = math.nan,
    ) -> float:
        """The command in the drive's unit, at the end of its range if none is enough; NaN if something is not a number.
        `parameters` (p,) replace the model's own; `before` is the command in force (NaN: the tried one, for long).
        """
        self._before = before if self._remembers else math.nan
        self._parameters = self._kernels.parameters if parameters is None else parameters
        e, x_m = self._envelope, float(x[0])
        low, high = (max(e.low, x_m - e.gap_m), min(e.high, x_m + e.gap_m)) if e.placed else (e.low, e.high)
        if not (math.isfinite(low + high + disturbance_N + speed_m_s) and np.isfinite(x).all()):
            return math.nan
        below, above = (self._reached(x, c, disturbance_N, t) - speed_m_s for c in (low, high))
        if below * above >= 0:
            return low if (abs(below) < abs(above)) else high
        last, near = 0, _SHARE * (high - low)
        for _ in range(_EVALUATIONS):
            if high - low <= near or math.isnan(below + above):
                break
            middle = (low * above - high * below) / (above - below)
            middle = min(max(middle, low + 0.02 * (high - low)), high - 0.02 * (high - low))
            error = self._reached(x, middle, disturbance_N, t) - speed_m_s
            if error * above > 0:
                high, above = middle, error
                below, last = (0.5 * below if last == 1 else below), 1
            else:
                low, below = middle, error
                above, last = (0.5 * above if last == -1 else above), -1
        return 0.5 * (low + high)

    def _reached(self, x: Array, command: float, d: float, t: float) -> float:
        """Speed in m/s after `reach_s` under `command`."""
        self._state[0], self._d[0] = x, d
        k = self._kernels
        if not math.isnan(self._before):
            k.run(self._state, self._before, command, self._d, t, _JUMP_S, _JUMP_STEPS, self._parameters)
        k.run(self._state, command, command, self._d, t, k.tick_s, k.substeps, self._parameters)
        return float(self._state[0, 1])


_RESPONDING: Final = 0.7  # least time ahead of the inverse, as a share of the drive's response time
_NO_FASTER: Final = 0.75
"""Share of a lagging drive's time constant within which its inverse reaches the speed, and bound on the loop gain as a
share of one over that time. Of 0.2 to 1.0 each, over lags of 30 to 150 ms, these erred least; at 0.35 and a gain of 20
1/s the capsule oscillated, two to five times as much.
"""

_CALMEST: Final = 1 / 16  # least share of the first gain after halving: a gain of 40 1/s then bears a delay of 0.4 s
_LOOSE: Final = 2.0
"""Factor on the command for break-away: with 1 a model with too little friction would rest and learn nothing."""


def remembers(model: ControlModel, envelope: Envelope) -> bool:
    """Whether `model` remembers the carriage's path, as play does."""
    return envelope.placed and not all(isinstance(name, str) for name in model.states)


def loop_of(model: ControlModel, loop: Correction | None = None) -> tuple[Correction, float]:
    """The position loop of `model`'s drive, or `loop`, no faster than a lagging drive, and the inverse's reach in s."""
    loop = driven_of(model.drive).correction if loop is None else loop
    reach_s = max(loop.reach_s, _RESPONDING * model.response_s)
    if model.response_s > 0:
        loop = replace(loop, gain_1_s=min(loop.gain_1_s, _NO_FASTER / reach_s))
    return loop, reach_s


class Feedforward(Controller):
    """The command is the model's inverse from the reference's speed to its next one with a `Correction`, at the
    estimated wall displacement, slip and drive states, against the estimated disturbance.

    In stick the command follows the tension as it grows with the drag, in slip as it falls. With friction that falls
    with speed, a slow capsule gets more than the command for motion from rest, less the faster it is. At rest the
    command is in the middle of the friction band, so noise does not move the capsule. Never raises, bounded time.
    """

    name = "feedforward"

    def __init__(self, model: ControlModel, envelope: Envelope, loop: Correction | None = None) -> None:
        self.loop, self._reach_s = loop_of(model, loop)
        self._slowest_1_s = _CALMEST * self.loop.gain_1_s
        self._inverse = Inverse(model, envelope, self._reach_s)
        self._envelope = envelope
        self._returning, self._command = False, math.nan
        self._size = len(model.states)
        self._effects = any(p.effect for p in model.symbols.parameters)

    def reset(self, now: float, estimate: Estimate, command: float) -> None:
        """Begin anew; the supervisor blends the change-over."""
        self._returning, self._command = False, command

    def follow(self, command: float, rate: float) -> None:
        self._command = command

    def calm(self) -> bool:
        """Halve the loop gain, down to a sixteenth of the first."""
        loop = self.loop
        if loop.gain_1_s <= self._slowest_1_s:
            return False
        self.loop = replace(loop, gain_1_s=0.5 * loop.gain_1_s, most_m_s=0.5 * loop.most_m_s)
        return True

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Action:
        times = np.array([now, now + self._reach_s])
        positions, speeds = reference.position(times), reference.speed(times)
        state = np.array(estimate.state, dtype=float)
        if state.shape != (self._size,):
            return Action(math.nan, "failed")
        correction = self._correction(number(positions[0]) - state[0], number(speeds[1]))
        seen, state[1] = state[1], number(speeds[0]) + correction
        wanted = number(speeds[1]) + correction
        command = self._inverted(state, wanted, now, estimate)
        if (
            self._effects and abs(wanted) > self.loop.rest_m_s and seen / wanted < 1
        ):  # the base's friction grows with speed
            state[1] = math.copysign(self.loop.rest_m_s, wanted)
            push = self._envelope.sense * math.copysign(1.0, wanted)
            more = push * (self._inverted(state, state[1], now, estimate) - command)
            command += push * max(more, 0.0) * _LOOSE * min(1 - seen / wanted, 1.0)
        return Action(command, "ok" if math.isfinite(command) else "failed")

    def _inverted(self, state: Array, speed_m_s: float, now: float, estimate: Estimate) -> float:
        """The model's inverse from `state` with what the estimator has learned."""
        learned = estimate.adapted
        force, numbers = (
            (estimate.disturbance_N, None) if learned is None else (learned.disturbance_N, learned.parameters)
        )
        return self._inverse.command(state, number(force), speed_m_s, now, numbers, self._command)

    def _correction(self, error: float, speed: float) -> float:
        """Speed in m/s beyond the reference's that reduces `error` in m."""
        loop = self.loop
        wanted = min(max(loop.gain_1_s * error, -loop.most_m_s), loop.most_m_s)
        if abs(speed) > loop.rest_m_s:
            self._returning = False
            against = wanted * speed < 0 and abs(error) < loop.noise_m
            return math.copysign(min(abs(wanted), abs(speed)), wanted) if against else wanted
        self._returning = abs(error) > (0.5 if self._returning else 1.0) * loop.slack_m
        return wanted if self._returning else 0.0
