"""By how much setpoints come later than their counter says: what a gateway holds back ever longer."""

from __future__ import annotations

import math

from hil.bus.protection import COUNTS


class Lateness:
    """The counter is the sender's clock: one more each `cycle_s`. `late_s` is by how much the time between arrivals has
    outgrown the counter's, from the frame on that took the shortest way: max(0, late_s + dt (1 - drift_share) - n
    cycle_s) after dt s in which the counter went on by n. So a clock, or a sender, that is slower by `drift_share` is
    not told from a delay that grows by as much, and a delay that never changes is not seen.
    """

    __slots__ = ("_counter", "_cycle_s", "_share", "_stamp", "late_s")

    def __init__(self, cycle_s: float, drift_share: float) -> None:
        self._cycle_s, self._share = cycle_s, drift_share
        self._counter, self._stamp, self.late_s = 0, -math.inf, 0.0

    def heard(self, counter: int, stamp: float, longest_s: float) -> float:
        """`late_s` with the frame that has this `counter` and came at `stamp` in s; it begins anew after a silence of
        more than `longest_s`.
        """
        passed = stamp - self._stamp
        if 0 <= passed <= longest_s:
            counted = (counter - self._counter) % COUNTS * self._cycle_s
            self.late_s = max(self.late_s + passed * (1 - self._share) - counted, 0.0)
        else:
            self.late_s = 0.0
        self._counter, self._stamp = counter, stamp
        return self.late_s
