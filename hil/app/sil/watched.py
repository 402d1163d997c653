"""A run over the simulated bus for others to watch: its frames on a local bus, no faster than in real time."""

from __future__ import annotations

import time
from typing import Any

import can

from hil.bus.local import LocalBus


class Watched:
    """Passes every frame of the simulated bus on to the local bus `channel`, on which nobody is listened to.

    The frames' simulated times are kept to by the wall clock, from the first one on: a run that could be faster waits.
    A local bus that takes no more frames costs the run nothing but what is shown of it.
    """

    def __init__(self, channel: str) -> None:
        """Raises ValueError where there can be no such bus."""
        try:
            self._bus = LocalBus(channel, fd=True)
        except can.CanInitializationError as error:
            raise ValueError(f"--watch must name a local bus that opens; got {channel!r}: {error}") from None
        self._zero_s = float("nan")

    def __call__(self, message: can.Message) -> None:
        """One frame, as it leaves the wire."""
        now = time.monotonic()
        if self._zero_s != self._zero_s:
            self._zero_s = now - message.timestamp
        time.sleep(max(0.0, self._zero_s + message.timestamp - now))
        shown = can.Message(
            arbitration_id=message.arbitration_id,
            is_extended_id=message.is_extended_id,
            is_fd=message.is_fd,
            bitrate_switch=message.bitrate_switch,
            data=message.data,
        )
        try:
            self._bus.send(shown)
        except can.CanError:
            return

    def close(self) -> None:
        """Leave the local bus."""
        self._bus.shutdown()

    def __enter__(self) -> Watched:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()
