"""What was measured while a controller led, for whoever learns from it."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from controller.signals import Array, Measurement

ROOM: Final = 1 << 18
"""Readings that are kept of a channel: nine minutes at 500 Hz."""

_FIRST_LOOK: Final = 256  # rows that are looked back through first


class History:
    """Keeps the newest `room` readings of each of `channels`; room is there from the start. `add` never raises."""

    def __init__(self, channels: Sequence[str], room: int = ROOM) -> None:
        self._rows = {name: np.full((2, room), np.nan) for name in channels}  # times and values, in a ring
        self._counts, self._room = dict.fromkeys(channels, 0), room

    def add(self, measurements: Sequence[Measurement]) -> None:
        """Keep what came in; other channels are left out."""
        for m in measurements:
            if m.channel in self._rows:
                self._rows[m.channel][:, self._counts[m.channel] % self._room] = m.stamp_s, m.value
                self._counts[m.channel] += 1

    def since(self, channel: str, begin_s: float) -> tuple[Array, Array]:
        """Times from `begin_s` on, increasing, and values of a channel, (n,) each; readings out of order are left out.
        It takes as long as those readings are many, not as the room is large: a tick may ask.
        """
        rows, count = self._rows[channel], self._counts[channel]
        there, end = min(count, self._room), count % self._room
        reach = min(_FIRST_LOOK, there)
        while reach < there and rows[0, (count - reach) % self._room] >= begin_s:
            reach = min(2 * reach, there)
        newest = np.hstack((rows[:, end - reach :], rows[:, :end])) if reach > end else rows[:, end - reach : end]
        times, values = newest[:, (newest[0] >= begin_s) & np.isfinite(newest[1])]
        new = times > np.maximum.accumulate(np.append(-np.inf, times))[:-1]
        return times[new], values[new]
