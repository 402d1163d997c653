"""Who was late: setpoints that a gateway holds back ever longer, by their counter, or the controller itself."""

import math
from typing import Final

from hil.bus.protection import COUNTS

FILLED: Final = 16
"""Frames that wait after a pause of any length, however small the bus's queue; a tick on time finds a few."""


def paused(gap_s: float) -> str:
    """The reason of a stop for a controller that did nothing for `gap_s`."""
    return f"controller paused for {gap_s:.2g} s"


def gap_words(gap_s: float, tick_s: float, reports: int, frames: int) -> str:
    """What a step of the clock was: a pause, where the frames that waited fill the time, else a jump."""
    filled = 2 * reports >= gap_s / tick_s - 1 or frames >= FILLED
    return paused(gap_s) if filled and gap_s > tick_s else "clock jumped"


class Lateness:
    """The sender's counter is its clock, one more each `cycle_s`: `late_s = max(0, late_s + dt (1 - drift_share) - n
    cycle_s)` after dt s in which it went on by n. A sender slower by `drift_share` is not told from a growing delay,
    and a delay that never changes is not seen.
    """

    __slots__ = ("_counter", "_cycle_s", "_share", "_stamp", "late_s")

    def __init__(self, cycle_s: float, drift_share: float) -> None:
        self._cycle_s, self._share = cycle_s, drift_share
        self._counter, self._stamp, self.late_s = 0, -math.inf, 0.0

    def heard(self, counter: int, stamp: float, longest_s: float) -> float:
        """`late_s` with the frame that came at `stamp` in s; it begins anew after a silence of `longest_s`."""
        passed = stamp - self._stamp
        if 0 <= passed <= longest_s:
            counted = (counter - self._counter) % COUNTS * self._cycle_s
            self.late_s = max(self.late_s + passed * (1 - self._share) - counted, 0.0)
        else:
            self.late_s = 0.0
        self._counter, self._stamp = counter, stamp
        return self.late_s
