"""Plausibility checks of the controller node: stuck sensor, drive that does not follow, jumps of the position."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

CHANCE: Final = 1e-7  # probability that a sound sensor's readings are equal so often that they count as stuck
STEP_M: Final = 2e-7  # step of the position on the bus: no localisation is finer
LONGEST: Final = 500  # largest number of equal readings that is asked for: 5 s of a sensor that reads every 10 ms
FARTHEST_M: Final = 0.01
"""Distance of the reference, beyond two steps of the sensor, after which the reading must have changed."""


def readings_alike(noise_m: float, resolution_m: float) -> float:
    """How many equal readings in a row mean a stuck sensor. White noise of standard deviation s (`noise_m`) stays
    within a step r (`resolution_m`) with the probability `p = erf(r/(2 sqrt(2) s))` at most, so n readings are equal
    with `p^(n - 1)`. Above `LONGEST`, or without noise, it is inf: so coarse a sensor may stay constant.
    """
    if noise_m <= 0:
        return math.inf
    stays = math.erf(max(resolution_m, STEP_M) / (2 * math.sqrt(2) * noise_m))
    count = 1 + math.ceil(math.log(CHANCE) / math.log(stays)) if stays < 1 else math.inf
    return count if count <= LONGEST else math.inf


@dataclass
class Plausibility:
    """The drive does not follow if, for `follow_ticks` in a row, its report is farther than `follow` from the commands
    of the last `lag_ticks` (in their unit), or unchanged to the last bit though the command moved by `follow`/10.

    The localisation is stuck if its readings (noise `noise_m`, steps `resolution_m`) are equal for longer than chance
    allows (`readings_alike`), or while the reference moves by `FARTHEST_M` and two steps.
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
    _commanded: float = math.nan
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

    def wanted(self, position_m: float) -> None:
        """The reference is at `position_m` while the drive is enabled."""
        self._least, self._most = min(self._least, position_m), max(self._most, position_m)

    def tick(self, command: float, reports: Sequence[float]) -> None:
        """The drive was sent `command` and has sent `reports`, the newest last."""
        self._commands.append(command)
        if not reports:
            return
        newest = reports[-1]
        near = min(self._commands) - self.follow <= newest <= max(self._commands) + self.follow
        self.off = 0 if near and math.isfinite(command) else self.off + 1
        if newest != self._report:
            self._report, self._commanded = newest, command
        self.frozen = self.frozen + 1 if abs(command - self._commanded) > self.follow / 10 else 0

    def settle(self, restarts: int) -> None:
        """Reset for a drive at rest and an estimator that has restarted `restarts` times."""
        self.off, self.frozen, self.restarts = 0, 0, restarts
        self._commands.clear()
        self._least, self._most = math.inf, -math.inf

    def reason(self, restarts: int) -> str:
        """The reason to stop, "" without one; the estimator has restarted `restarts` times."""
        if self.alike >= self._stuck or self._most - self._least > self._way_m:
            return "localisation stuck"
        if max(self.off, self.frozen) >= self.follow_ticks:
            return "drive does not follow"
        if restarts > self.restarts:
            return "localisation jumped"
        return ""
