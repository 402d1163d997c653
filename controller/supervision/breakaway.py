"""The speed of a coil's capsule that breaks away between two readings, and the push that keeps it within its limit."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np

from controller.drives import Actuator
from controller.limits import Envelope, number
from controller.model.control_model import ControlModel, mean_frictions
from models.rigs.kinds import surface_of

_TICKS: Final = 512  # ticks without a reading that are kept
_MOST: Final = 0.8  # share of the speed limit that a capsule may reach unseen at most
_SPEEDS: Final = 61  # of a resistance
_SLOW_M_S: Final = 1e-3  # the slowest of them
_SHARE: Final = 0.8  # share of the model's friction that holds a sliding capsule back


@dataclass(frozen=True, slots=True)
class Resistance:
    """What holds a coil's capsule back: the `commands` that keep it at speeds evenly spaced from 0 to `speed_m_s`, and
    the acceleration in m/s^2 per unit of command beyond them. Without `gain_m_s2` no push is limited.
    """

    commands: tuple[float, ...] = (math.inf, math.inf)
    speed_m_s: float = 1.0
    gain_m_s2: float = 0.0

    @property
    def friction(self) -> float:
        """The command that overcomes friction from rest."""
        return self.commands[0]

    def at(self, speed_m_s: float) -> float:
        """The command that keeps the speed."""
        place = speed_m_s / self.speed_m_s * (len(self.commands) - 1)
        k = min(int(place), len(self.commands) - 2)
        return self.commands[k] + (place - k) * (self.commands[k + 1] - self.commands[k])


FREE: Final = Resistance()


def resistance_of(model: ControlModel, envelope: Envelope) -> Resistance:
    """What holds back the capsule that a coil pushes, by its mean friction; without numbers for other drives."""
    if envelope.placed or envelope.shaken:
        return FREE
    actuator, fastest = Actuator(model.drive, model.theta.base, envelope), envelope.limits.speed_m_s
    speeds = np.linspace(0.0, fastest, _SPEEDS)
    frictions = mean_frictions(model, np.maximum(speeds, _SLOW_M_S)).tolist()
    held = zip(frictions, speeds.tolist(), strict=True)
    commands = tuple(max(abs(actuator.command(friction_N, 0.0, v)), 1e-9) for friction_N, v in held)
    return Resistance(commands, fastest, frictions[0] / surface_of(model.rig).body_kg / commands[0])


class Breakaway:
    """The greatest speed that a capsule may have by now, by direction of the command: what two readings show at the
    first one's stamp, and at least that until the second one's, grows by `v' = gain (command - 0.8 resistance(v))`
    under the commands since. A narrow place may let the capsule go at any time that no reading shows yet. No method
    raises or takes longer with time.
    """

    def __init__(self, resistance: Resistance, most_m_s: float = math.inf) -> None:
        """`most_m_s`: the speed at which a run ends, to which no push may lead."""
        self._resistance, self._most_m_s = resistance, min(most_m_s, _MOST * resistance.speed_m_s)
        self.begin()

    def begin(self) -> None:
        self._commands = deque[tuple[float, float, float]](maxlen=_TICKS)
        self._speeds, self._tick_s = [0.0, 0.0], math.inf

    def sent(self, until_s: float, command: object, dt: float) -> None:
        """`command` is in force for `dt` s until `until_s`; one that is no number is never sent."""
        push = number(command)
        if self._resistance.gain_m_s2 and math.isfinite(push):
            self._tick_s = dt
            self._commands.append((until_s, push, dt))
            self._go_on(push, dt, (0.0, 0.0))

    def saw(self, from_s: float, until_s: float, mean_m_s: float) -> None:
        """Readings of these stamps show a mean velocity, positive in the direction of positive commands."""
        while self._commands and self._commands[0][0] <= from_s:
            self._commands.popleft()
        shown = max(mean_m_s, 0.0), max(-mean_m_s, 0.0)
        self._speeds = [*shown]
        for end_s, command, dt in self._commands:
            self._go_on(command, dt, shown if end_s <= until_s else (0.0, 0.0))

    def _go_on(self, command: float, dt: float, least: tuple[float, float]) -> None:
        for k, push in enumerate((command, -command)):
            beyond = push - _SHARE * self._resistance.at(self._speeds[k])
            self._speeds[k] = max(self._speeds[k] + self._resistance.gain_m_s2 * dt * beyond, least[k])

    @property
    def room(self) -> tuple[float, float]:
        """Least and greatest command for the next tick."""
        if not self._resistance.gain_m_s2:
            return -math.inf, math.inf
        forth, back = (max(_SHARE * self._resistance.at(speed) + self._left(speed), 0.0) for speed in self._speeds)
        return -back, forth

    def _left(self, speed_m_s: float) -> float:
        """The push beyond resistance that takes the speed to the greatest in a tick, negative beyond it."""
        return (self._most_m_s - speed_m_s) / (self._resistance.gain_m_s2 * self._tick_s)
