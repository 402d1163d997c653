"""Frames and base classes of our own buses, and reading from a bus whose driver may raise."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import can


def fd_frame(identifier: int, data: bytes) -> can.Message:
    """A CAN FD frame with a switched bit rate, extended where its identifier needs it, for sending."""
    long = identifier > 0x7FF
    return can.Message(0.0, identifier, long, is_fd=True, bitrate_switch=True, data=data, is_rx=False)


def classic_frame(identifier: int, data: bytes | bytearray, stamp: float = 0.0, *, heard: bool = False) -> can.Message:
    """A classic data frame with an 11-bit identifier, for sending or as a received one (`heard`)."""
    return can.Message(stamp, identifier, False, data=data, is_rx=heard)


def plain(message: can.Message) -> bool:
    """Whether a frame is a classic data frame with an 11-bit identifier; every other frame is ignored."""
    return not (message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd)


class OwnBus(can.BusABC):
    """A bus without periodic sending: the frames of a dead process must end with it."""

    def send_periodic(self, *_: Any, **__: Any) -> Any:
        raise NotImplementedError(f"frames of {self.channel_info} are sent one by one")


class WrappingBus(OwnBus):
    """Passes frames, state and shutdown on to `inner`; subclasses override parts of it."""

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
        """Nothing to release; `inner` warns if it was not shut down."""

    def shutdown(self) -> None:
        super().shutdown()
        self.inner.shutdown()


def heard_for(bus: can.BusABC, seconds: float) -> Iterator[can.Message]:
    """The frames received within `seconds`; an error of the driver counts as a moment of silence."""
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
    """The waiting frames, at most `most`; an error of the driver ends them and is passed to `deaf`."""
    for _ in range(most):
        try:
            message = bus.recv(0)
        except Exception as error:  # noqa: BLE001 - drivers of many makers raise whatever they like
            deaf(error)
            return
        if message is None:
            return
        yield message
