"""Listening to a bus whose driver may raise: for a while, or to what waits there."""

import time
from collections.abc import Callable, Iterator

import can


def heard_for(bus: can.BusABC, seconds: float) -> Iterator[can.Message]:
    """The frames that come within `seconds`; whatever a driver raises is a moment in which nothing is heard."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        try:
            message = bus.recv(left)
        except Exception:  # noqa: BLE001 - drivers of many makers raise whatever they like
            time.sleep(0.001)
            continue
        if message is not None:
            yield message


def waiting(
    bus: can.BusABC, most: int, deaf: Callable[[Exception], object] = lambda error: None
) -> Iterator[can.Message]:
    """The frames that wait, at most `most`; on a bus that raises nothing does, and `deaf` hears what it says."""
    for _ in range(most):
        try:
            message = bus.recv(0)
        except Exception as error:  # noqa: BLE001 - drivers of many makers raise whatever they like
            deaf(error)
            return
        if message is None:
            return
        yield message
