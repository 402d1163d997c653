"""What was measured while a controller led, for whoever learns from it."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from controller.signals import Array, Measurement

ROOM: Final = 1 << 18
"""Readings that are kept of a channel: nine minutes at 500 Hz."""

_FIRST_LOOK: Final = 256  # rows that are looked back through first


class _Ring:
    """The newest readings of one channel."""

    def __init__(self, room: int) -> None:
        self.times, self.values, self.count = np.full(room, np.nan), np.full(room, np.nan), 0

    def since(self, begin_s: float) -> tuple[Array, Array]:
        reach, end = self._reach(begin_s), self.count % self.times.size
        times, values = (
            np.concatenate((a[end - reach :], a[:end])) if reach > end else a[end - reach : end]
            for a in (self.times, self.values)
        )
        kept = (times >= begin_s) & np.isfinite(values)
        later = np.maximum.accumulate(np.append(-np.inf, times[kept]))[:-1]
        new = times[kept] > later
        return times[kept][new], values[kept][new]

    def _reach(self, begin_s: float) -> int:
        """How many of the newest readings hold all from `begin_s` on; those before them are not looked at."""
        there = min(self.count, self.times.size)
        reach = min(_FIRST_LOOK, there)
        while reach < there and self.times[(self.count - reach) % self.times.size] >= begin_s:
            reach = min(2 * reach, there)
        return reach


class History:
    """Keeps the newest `room` readings of each of `channels`; room is there from the start. `add` never raises."""

    def __init__(self, channels: Sequence[str], room: int = ROOM) -> None:
        self._rings = {name: _Ring(room) for name in channels}

    def add(self, measurements: Sequence[Measurement]) -> None:
        """Keep what came in; other channels are left out."""
        for m in measurements:
            ring = self._rings.get(m.channel)
            if ring is not None:
                at = ring.count % ring.times.size
                ring.times[at], ring.values[at] = m.stamp_s, m.value
                ring.count += 1

    def since(self, channel: str, begin_s: float) -> tuple[Array, Array]:
        """Times from `begin_s` on, increasing, and values of a channel, (n,) each; readings out of order are left out.
        It takes as long as those readings are many, not as the room is large: a tick may ask.
        """
        return self._rings[channel].since(begin_s)
