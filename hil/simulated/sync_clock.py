"""When the controller's ticks begin by a drive's own clock, so that a command that comes late is known to be old."""

import math
from typing import Final

from hil.bus.protection import COUNTS

DRIFT: Final = 5e-4
"""Share by which two clocks may go apart; what comes later by less than that each second is not told from them."""
SILENCE_S: Final = 0.06  # A controller without SYNC for so long counts as another one


class SyncClock:
    """Tick n of period T begins at o + n T, where o is the least of `stamp - n T` over the SYNC frames so far. It grows
    by `DRIFT` a second, and begins anew once SYNC has been silent. While it lives no other time is let in: a SYNC that
    counts back, or whose tick would have begun more than `SILENCE_S` off, is another controller's or a recording.

    A command belongs to the SYNC with its own counter of 4 bits, so one that is 16 ticks late from the beginning on is
    not told.
    """

    def __init__(self) -> None:
        self._offset = math.inf
        self._stamp = -math.inf
        self._tick, self._counter, self._period_s = -1, 0, 0.0

    def sync(self, counter: int, tick: int, period_s: float, stamp: float) -> bool:
        """SYNC number `tick` came at `stamp`; whether it was let in."""
        if not 0 <= stamp - self._stamp <= SILENCE_S:
            self._offset = math.inf
        elif tick <= self._tick or abs(stamp - self._offset - tick * period_s) > SILENCE_S:
            return False
        self._offset = min(self._offset + DRIFT * (stamp - self._stamp), stamp - tick * period_s)
        self._tick, self._counter, self._period_s, self._stamp = tick, counter, period_s, stamp
        return True

    def begin(self, counter: int, stamp: float) -> float:
        """When the tick began of the command with this `counter` that came at `stamp`."""
        if self._tick < 0:
            return stamp
        ahead = (counter - self._counter) % COUNTS
        room = (stamp - self._stamp) / self._period_s + 0.5
        ticks = ahead + COUNTS * math.floor((room - ahead) / COUNTS)
        return self._offset + (self._tick + ticks) * self._period_s
