"""Buses of our own: what all of them refuse, and what those around another one pass on."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import can


def fd_frame(identifier: int, data: bytes) -> can.Message:
    """A CAN FD frame with a switched bit rate, extended where its identifier needs it, for sending."""
    long = identifier > 0x7FF
    return can.Message(0.0, identifier, long, is_fd=True, bitrate_switch=True, data=data, is_rx=False)


def classic_frame(identifier: int, data: bytes | bytearray, stamp: float = 0.0, *, heard: bool = False) -> can.Message:
    """A classic data frame with an 11-bit identifier, for sending, or as one that was `heard`."""
    return can.Message(stamp, identifier, False, data=data, is_rx=heard)


class OwnBus(can.BusABC):
    """Frames are sent one by one: those of a dead process, or a dead controller's commands, must end with it."""

    def send_periodic(self, *_: Any, **__: Any) -> Any:
        raise NotImplementedError(f"frames of {self.channel_info} are sent one by one")


class WrappingBus(OwnBus):
    """Passes frames, state and the end on to `inner`; a subclass changes what it is there to change."""

    def __init__(self, inner: can.BusABC, channel_info: str) -> None:
        super().__init__(channel=inner.channel_info)
        self.inner, self.channel_info = inner, channel_info

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.inner.send(msg, timeout)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        return self.inner.recv(timeout)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return self.recv(timeout), False

    @property
    def state(self) -> can.BusState:
        return self.inner.state

    @state.setter
    def state(self, new_state: can.BusState) -> None:
        self.inner.state = new_state

    def __del__(self) -> None:
        """Nothing of its own to release; `inner` warns where it was not closed."""

    def shutdown(self) -> None:
        super().shutdown()
        self.inner.shutdown()


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
