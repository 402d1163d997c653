"""A run over the simulated bus for others to watch: its frames on a local bus, no faster than in real time."""

from __future__ import annotations

import contextlib
import math
import time
from typing import Any

import can

from hil.app.scenario.bus_scenario import watched_bus


class Watched:
    """Passes every frame of the simulated bus on to the local bus `channel`, on which nobody is listened to.

    The frames' simulated times are kept to by the wall clock, from the first one on: a run that could be faster waits.
    A local bus that takes no more frames costs the run nothing but what is shown of it.
    """

    def __init__(self, channel: str) -> None:
        """Raises ValueError where there can be no such bus."""
        self._bus = watched_bus(channel)
        self._zero_s = math.nan

    def __call__(self, message: can.Message) -> None:
        """One frame, as it leaves the wire."""
        now = time.monotonic()
        if math.isnan(self._zero_s):
            self._zero_s = now - message.timestamp
        time.sleep(max(0.0, self._zero_s + message.timestamp - now))
        shown = can.Message(
            arbitration_id=message.arbitration_id,
            is_extended_id=message.is_extended_id,
            is_fd=message.is_fd,
            bitrate_switch=message.bitrate_switch,
            data=message.data,
        )
        with contextlib.suppress(can.CanError):
            self._bus.send(shown)

    def __enter__(self) -> Watched:
        return self

    def __exit__(self, *_: Any) -> None:
        self._bus.shutdown()
