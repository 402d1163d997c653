"""Changing over between controllers: which of them may be asked, and a step between their commands that fades."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Rungs:
    """`count` controllers, best first; a failed one waits `retry_s`, twice as long each time up to `longest_s`, all in s, and starts
    anew after `forgive_s` of good work."""

    count: int
    retry_s: float
    longest_s: float
    forgive_s: float


class Ladder:
    """Which controllers are suspended, and until when."""

    def __init__(self, rungs: Rungs) -> None:
        self._rungs = rungs
        self._closed_until = [-math.inf] * rungs.count
        self._wait = [rungs.retry_s] * rungs.count
        self._good_since = [math.inf] * rungs.count

    def open(self, now: float) -> Iterator[int]:
        """The controllers that may be asked at `now`, best first."""
        for rung, until in enumerate(self._closed_until):
            if now >= until:
                yield rung

    def failed(self, rung: int, now: float) -> None:
        """Suspend a controller."""
        self._closed_until[rung] = now + self._wait[rung]
        self._wait[rung] = min(2 * self._wait[rung], max(self._rungs.longest_s, self._rungs.retry_s))
        self._good_since[rung] = math.inf

    def worked(self, rung: int, now: float) -> None:
        """A controller gave a usable answer."""
        self._good_since[rung] = min(self._good_since[rung], now)
        if now - self._good_since[rung] >= self._rungs.forgive_s:
            self._wait[rung] = self._rungs.retry_s


class Blend:
    """A step that fades linearly to 0 within `time_s`."""

    def __init__(self, time_s: float) -> None:
        self._time = time_s
        self._step, self._since = 0.0, -math.inf
        self.left = 0.0

    def begin(self, step: float, now: float) -> None:
        """Hide `step` = old command - new command from `now` on."""
        self._step, self._since = step, now

    def smooth(self, command: float, now: float) -> float:
        """`command` with what is `left` of the step."""
        share = max(0.0, 1 - max(now - self._since, 0.0) / self._time) if self._time > 0 else 0.0
        self.left = self._step * share
        return command + self.left
