"""What makes the controller node stop trusting what it is told: stuck sensor, drive that does not follow, jumps."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

CHANCE: Final = 1e-7  # with which a sound sensor's readings are alike for so long that they count as stuck
STEP_M: Final = 2e-7  # step of the position on the bus: no localisation is finer
LONGEST: Final = 500  # readings alike that count as stuck however coarse the sensor: 5 s of one that reads every 10 ms
FARTHEST_M: Final = 0.01
"""Way of the wanted position, beyond two of the sensor's steps, over which no reading may stay as it is."""


def readings_alike(noise_m: float, resolution_m: float) -> float:
    """How many readings in a row without any variance mean a stuck sensor: white noise of standard deviation `noise_m`
    stays within a step of `resolution_m` with the probability `p = erf(r/(2 sqrt(2) s))` at most, so n readings are
    alike with `p^(n - 1)`. From `LONGEST` on, or without noise, inf: a sensor that coarse may rest.
    """
    if noise_m <= 0:
        return math.inf
    stays = math.erf(max(resolution_m, STEP_M) / (2 * math.sqrt(2) * noise_m))
    count = 1 + math.ceil(math.log(CHANCE) / math.log(stays)) if stays < 1 else math.inf
    return count if count <= LONGEST else math.inf


@dataclass
class Plausibility:
    """`follow` is how far the drive's report may be off the commands of the last `lag_ticks`, in their unit, for less
    than `follow_ticks` in a row; or be the same to the last bit after the command has moved by `follow`/10.

    The localisation is stuck where its readings (`noise_m`, steps of `resolution_m`) are alike for longer than chance
    allows (`readings_alike`), or while the wanted position goes `FARTHEST_M` and two steps.
    """

    follow: float
    noise_m: float = 5e-4
    resolution_m: float = 0.0
    lag_ticks: int = 1
    follow_ticks: int = 5
    alike: int = 0
    off: int = 0
    frozen: int = 0
    restarts: int = 0
    _last: float = math.nan
    _report: float = math.nan
    _told: float = math.nan
    _least: float = math.inf
    _most: float = -math.inf

    def __post_init__(self) -> None:
        self._stuck = readings_alike(self.noise_m, self.resolution_m)
        self._way_m = FARTHEST_M + 2 * self.resolution_m
        self._commands: deque[float] = deque(maxlen=self.lag_ticks)

    def saw(self, value: float) -> None:
        same = value == self._last
        self.alike = self.alike + 1 if same else 1
        self._last = value
        if not same:
            self._least, self._most = math.inf, -math.inf

    def wanted(self, place_m: float) -> None:
        """The capsule is wanted at `place_m`, while the drive leads it."""
        self._least, self._most = min(self._least, place_m), max(self._most, place_m)

    def tick(self, told: float, reports: Sequence[float]) -> None:
        """The drive has said `reports`, in their order, up to which it was `told` something."""
        self._commands.append(told)
        if not reports:
            return
        newest = reports[-1]
        near = min(self._commands) - self.follow <= newest <= max(self._commands) + self.follow
        self.off = 0 if near and math.isfinite(told) else self.off + 1
        if newest != self._report:
            self._report, self._told = newest, told
        self.frozen = self.frozen + 1 if abs(told - self._told) > self.follow / 10 else 0

    def settle(self, restarts: int) -> None:
        """Begin anew with a drive that does nothing yet and an estimator that has begun anew `restarts` times."""
        self.off, self.frozen, self.restarts = 0, 0, restarts
        self._commands.clear()
        self._least, self._most = math.inf, -math.inf

    def reason(self, restarts: int) -> str:
        """Why to stop, "" where there is no reason; `restarts` of the estimator so far."""
        if self.alike >= self._stuck or self._most - self._least > self._way_m:
            return "localisation stuck"
        if max(self.off, self.frozen) >= self.follow_ticks:
            return "drive does not follow"
        if restarts > self.restarts:
            return "localisation jumped"
        return ""
