"""The trajectory that a moteus makes of its commands: at once where nothing limits it, else as its limits allow."""

import math
from dataclasses import dataclass
from typing import Final

_NO_LIMIT: Final = 1e9  # in turns and seconds


@dataclass
class MotorPath:
    """From a command on, `x = x_c + v_c t` is matched with at most `speed` (turns/s) and by accelerations of at most
    `acceleration` (turns/s2), nan where there is no limit. Without both, place and rate are the command's at once. A
    command without a place (nan) is one of speed alone.
    """

    place: float = 0.0
    rate: float = 0.0
    speed: float = math.nan
    acceleration: float = math.nan
    _target: float = math.nan
    _rate: float = 0.0

    def begin(self, place: float, rate: float) -> None:
        """Begin where the drive measures itself."""
        self.place, self.rate, self._target, self._rate = place, rate, math.nan, 0.0

    def command(self, place: float, rate: float, speed: float, acceleration: float) -> None:
        self.speed, self.acceleration = (limit if limit < _NO_LIMIT else math.nan for limit in (speed, acceleration))
        speed = self.speed
        rate = 0.0 if math.isnan(rate) else rate
        self._target, self._rate = place, rate if math.isnan(speed) else min(max(rate, -speed), speed)

    def step(self, dt: float) -> None:
        before, target = self.rate, self._target
        if math.isnan(self.speed) and math.isnan(self.acceleration):
            self.place, self.rate, self._target = target if math.isfinite(target) else self.place, self._rate, math.nan
            self.place += self.rate * dt
            return
        most = math.inf if math.isnan(self.acceleration) else self.acceleration * dt
        wanted = self._rate if math.isnan(target) else self._rate + self._closing(target - self.place, dt)
        if not math.isnan(self.speed):
            wanted = min(max(wanted, -self.speed), self.speed)
        self.rate = min(max(wanted, before - most), before + most)
        self.place += (self.rate if math.isinf(most) else 0.5 * (before + self.rate)) * dt
        self._target += self._rate * dt

    def _closing(self, gap: float, dt: float) -> float:
        """The speed beside the command's by which a gap closes in time, braking within the limit."""
        if math.isnan(self.acceleration):
            return gap / dt
        half = 0.5 * self.acceleration * dt
        return math.copysign(math.sqrt(half * half + 2.0 * self.acceleration * abs(gap)) - half, gap)
