"""What makes the controller node stop trusting what it is told: a stuck sensor, a drive that does not follow, a belief
that jumped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

SAME: Final = 3
"""Readings alike to the last bit, of a sensor with noise, that count as stuck: by chance once in 10^7 with 0.5 mm over
0.2 um.
"""


@dataclass
class Plausibility:
    """`follow` is how far the drive's report may be off the command in its unit, for less than `follow_ticks` in a row;
    a report that is still the same to the last bit after the command has moved by `follow`/20 may be so for as long.
    `noisy`: the localisation has so much noise that readings alike mean a stuck one.
    """

    follow: float
    noisy: bool = True
    follow_ticks: int = 5
    alike: int = 0
    off: int = 0
    frozen: int = 0
    restarts: int = 0
    _last: float = math.nan
    _report: float = math.nan
    _told: float = math.nan

    def saw(self, value: float) -> None:
        """A localisation reading came."""
        self.alike = self.alike + 1 if value == self._last else 1
        self._last = value

    def reported(self, value: float, told: float) -> None:
        """The drive reported `value` where it had been `told` something."""
        self.off = self.off + 1 if not abs(value - told) <= self.follow else 0
        if value != self._report:
            self._report, self._told = value, told
        self.frozen = self.frozen + 1 if abs(told - self._told) > self.follow / 20 else 0

    def settle(self, restarts: int) -> None:
        """Begin anew with a drive that does nothing yet and an estimator that has begun anew `restarts` times."""
        self.off, self.frozen, self.restarts = 0, 0, restarts

    def reason(self, restarts: int) -> str:
        """Why to stop, "" where there is no reason; `restarts` of the estimator so far."""
        if self.noisy and self.alike >= SAME:
            return "localisation stuck"
        if max(self.off, self.frozen) >= self.follow_ticks:
            return "drive does not follow"
        if restarts > self.restarts:
            return "localisation jumped"
        return ""
