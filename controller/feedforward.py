"""Feedforward: the model inverted along the reference against the wall as it is believed, and a slow position loop."""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from controller.drives import driven_of
from controller.limits import Envelope, number
from controller.model.control_model import ControlModel
from controller.model.inverse import Inverse
from controller.signals import Action, Array, Controller, Estimate, Reference
from controller.tuned import Correction

_RESPONDING: Final = 0.7  # of the drive's response time, the least time ahead that is inverted for
_NO_FASTER: Final = 0.75
"""In what share of a drive's time constant the inverse of a lagging drive gets to its speed, and what pace of the loop
that allows, as a share of one over that time. Of 0.2 to 1.0 and paces of 0.2 to 1.0, over lags of 30 to 150 ms, these
erred least; at 0.35 and a pace of 20 1/s the capsule swung, two to five times as much.
"""

_CALMEST: Final = 1 / 16
"""Share of its first pace down to which the loop is halved: one of 40 1/s then bears a delay of 0.4 s."""
_LOOSE: Final = 2.0
"""Times what a break-away takes beyond motion: at just as much a model that holds too little stays at rest with the
capsule and learns nothing.
"""


class Feedforward(Controller):
    """The command is the model's inverse for going on from the reference's speed to the next one's with a `Correction`,
    from the wall displacement, slip and drive states of the estimate, against its disturbance.

    In stick the tension that grows with the drag is followed, in slip its fall. Where friction falls with speed, a
    capsule that is too slow gets more than the command that takes it on from rest, the less of it the faster it is; at
    rest the command sits in the middle of what friction holds, so noise does not move the capsule. Never raises,
    bounded time.
    """

    name = "feedforward"

    def __init__(self, model: ControlModel, envelope: Envelope, loop: Correction | None = None) -> None:
        loop = driven_of(model.drive).correction if loop is None else loop
        self._reach_s = max(loop.reach_s, _RESPONDING * model.response_s)
        self.loop = (
            replace(loop, pace_1_s=min(loop.pace_1_s, _NO_FASTER / self._reach_s)) if model.response_s > 0 else loop
        )
        self._slowest_1_s = _CALMEST * self.loop.pace_1_s
        self._inverse = Inverse(model, envelope, self._reach_s)
        self._envelope = envelope
        self._returning, self._command = False, math.nan
        self._size = len(model.states)
        self._effects = any(p.effect for p in model.symbols.parameters)

    def reset(self, now: float, estimate: Estimate, command: float) -> None:
        """Begin anew; whoever changes over blends."""
        self._returning, self._command = False, command

    def follow(self, command: float, rate: float) -> None:
        """Hear the command in force."""
        self._command = command

    def calm(self) -> bool:
        """Take errors back at half the pace, down to a sixteenth of the first."""
        loop = self.loop
        if loop.pace_1_s <= self._slowest_1_s:
            return False
        self.loop = replace(loop, pace_1_s=0.5 * loop.pace_1_s, most_m_s=0.5 * loop.most_m_s)
        return True

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Action:
        """The command for the tick that begins at `now` in s; `failed` where estimate or reference is no number."""
        times = np.array([now, now + self._reach_s])
        places, speeds = reference.position(times), reference.speed(times)
        state = np.array(estimate.state, dtype=float)
        if state.shape != (self._size,):
            return Action(math.nan, "failed")
        correction = self._correction(number(places[0]) - state[0], number(speeds[1]))
        seen, state[1] = state[1], number(speeds[0]) + correction
        wanted = number(speeds[1]) + correction
        command = self._turned_round(state, wanted, now, estimate)
        if (
            self._effects and abs(wanted) > self.loop.rest_m_s and seen / wanted < 1
        ):  # the base's friction grows with speed
            state[1] = math.copysign(self.loop.rest_m_s, wanted)
            push = self._envelope.sense * math.copysign(1.0, wanted)
            more = push * (self._turned_round(state, state[1], now, estimate) - command)
            command += push * max(more, 0.0) * _LOOSE * min(1 - seen / wanted, 1.0)
        return Action(command, "ok" if math.isfinite(command) else "failed")

    def _turned_round(self, state: Array, speed_m_s: float, now: float, estimate: Estimate) -> float:
        """The model's inverse from `state` with what the estimator has learned."""
        learned = estimate.adapted
        force, numbers = (
            (estimate.disturbance_N, None) if learned is None else (learned.disturbance_N, learned.parameters)
        )
        return self._inverse.command(state, number(force), speed_m_s, now, numbers, self._command)

    def _correction(self, error: float, speed: float) -> float:
        """Speed in m/s beyond the reference's that takes `error` in m back."""
        loop = self.loop
        wanted = min(max(loop.pace_1_s * error, -loop.most_m_s), loop.most_m_s)
        if abs(speed) > loop.rest_m_s:
            self._returning = False
            against = wanted * speed < 0 and abs(error) < loop.noise_m
            return math.copysign(min(abs(wanted), abs(speed)), wanted) if against else wanted
        self._returning = abs(error) > (0.5 if self._returning else 1.0) * loop.slack_m
        return wanted if self._returning else 0.0
