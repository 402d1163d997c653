"""Feedforward compensation: the model inverted along the reference, with the wall as the estimator sees it, and a slow
position loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from controller.limits import Envelope, number
from controller.model.control_model import ControlModel
from controller.model.inverse import Inverse
from controller.signals import Action, Array, Controller, Estimate, Reference

_RESPONDING: Final = 0.7
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


@dataclass(frozen=True)
class Loop:
    """How errors are taken back: the speed asked for is `r' + pace_1_s (r - x)` with these bounds.

    While the reference moves, a capsule ahead by less than `noise_m` waits for it at the most, so that noise does not
    turn friction round; no correction exceeds `most_m_s`. At rest errors up to `slack_m` are left alone, which is what
    keeps a held capsule from hunting; beyond it the capsule is brought back to half of that. `reach_s` is the time
    within which the inverse gets to the speed; a coil's must leave its current some ticks, and a lagging drive gets
    most of its time constant, with a slower pace.
    """

    pace_1_s: float = 20.0
    noise_m: float = 1.6e-3
    most_m_s: float = 10e-3
    slack_m: float = 0.4e-3
    rest_m_s: float = 2e-5
    reach_s: float = 1e-3

    def __post_init__(self) -> None:
        for name in (f.name for f in fields(self)):
            if not 0 <= getattr(self, name) < math.inf:
                raise ValueError(f"loop {name} must be zero or more; got {getattr(self, name)!r}")


LOOPS = {"magnetic": Loop(), "coil": Loop(pace_1_s=40.0, noise_m=0.4e-3, most_m_s=20e-3, reach_s=4e-3)}


class Feedforward(Controller):
    """Each tick the capsule is to go on from the reference's speed to the next one's, corrected by `Loop`; the command
    is the model's inverse for that, from the wall displacement, slip and drive states of the estimate, against its
    disturbance.

    In stick the tension that grows with the drag is followed, in slip its fall. Where friction falls with speed, a
    capsule that is slower than asked for gets more than the command that takes it on from rest, the less of it the
    faster it is; at rest the command sits in the middle of what friction holds, so neither noise nor a small error
    moves the capsule. Never raises, bounded time.
    """

    name = "feedforward"

    def __init__(self, model: ControlModel, envelope: Envelope, loop: Loop | None = None) -> None:
        loop = LOOPS.get(envelope.kind, Loop()) if loop is None else loop
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
        """Begin anew; but for what play remembers of `command` the answer depends on the estimate alone, so whoever
        changes over blends.
        """
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
