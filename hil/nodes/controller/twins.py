"""Two nodes that send the same heartbeat: told by an uptime that goes back again and again, as no node's own does."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from hil.bus.catalogue import Frame
from hil.bus.protection import crc8

BACK_S: Final = 0.5
"""By how much an uptime must go back: further than frames that a link swaps or repeats."""
BACKS: Final = 3
"""How often; a node that boots anew goes back once, and not again within `WITHIN_S`."""
WITHIN_S: Final = 0.5


class Twins:
    """Hears every frame of one heartbeat whose CRC is right, also those whose counter is refused, as one of two
    senders' always is. Two that began within `BACK_S` of each other are not told apart.
    """

    __slots__ = ("_backs", "_data_id", "_length", "_mask", "_shift", "_step_s", "_up_s", "heard_at", "name")

    def __init__(self, heartbeat: Frame) -> None:
        uptime = heartbeat.field("Uptime_s")
        self.name, self._data_id, self._length = heartbeat.name, heartbeat.data_id, heartbeat.length
        self._shift, self._mask, self._step_s = uptime.start, (1 << uptime.length) - 1, uptime.scale
        self._backs: deque[float] = deque(maxlen=BACKS)
        self._up_s, self.heard_at = 0.0, -math.inf

    def hear(self, data: bytes | bytearray, stamp: float) -> None:
        """A frame of this heartbeat came at `stamp`."""
        if len(data) != self._length or crc8(memoryview(data)[1:], self._data_id) != data[0]:
            return
        up_s = (int.from_bytes(data, "little") >> self._shift & self._mask) * self._step_s
        if up_s < self._up_s - BACK_S:
            self._backs.append(stamp)
        self._up_s, self.heard_at = up_s, stamp

    def two(self, now: float) -> bool:
        """Whether two nodes have sent it of late."""
        return len(self._backs) == BACKS and now - self._backs[0] <= WITHIN_S
