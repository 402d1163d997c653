"""moteus frames: registers written, read and told, all as floats but the mode that is written. Source: the maker's
description of its CAN protocol and registers.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Final

import can

MODE, POSITION, VELOCITY, HOME_STATE, FAULT_CODE = 0x00, 0x01, 0x02, 0x0C, 0x0F
COMMAND_POSITION, MAXIMUM_TORQUE, WATCHDOG_TIMEOUT, SET_OUTPUT_EXACT = 0x20, 0x25, 0x27, 0x131
STOPPED, FAULTED, POSITION_MODE, TIMED_OUT = 0, 1, 10, 11
"""Modes; 2 to 4 are on the way to one that operates."""
WRITE_INT8, WRITE_FLOAT, READ_INT8, READ_FLOAT, REPLY_INT8, REPLY_FLOAT = 0x00, 0x0C, 0x10, 0x1C, 0x20, 0x2C
STREAM_TO_SERVO, STREAM_FROM_SERVO, STREAM_POLL = 0x40, 0x41, 0x42
REPLY_WANTED: Final = 0x8000
HOST: Final = 0x7A
"""The controller's number as a source: no reply to it has an identifier of the catalogue."""
BROADCAST: Final = 0x7F
NOP: Final = 0x50
_LENGTHS: Final = (*range(9), 12, 16, 20, 24, 32, 48, 64)
_SIZES: Final = (1, 2, 4, 4)
_FORMATS: Final = ("<b", "<h", "<i", "<f")


def _varuint(number: int) -> bytes:
    head = b""
    while number >= 0x80:
        head, number = head + bytes([number & 0x7F | 0x80]), number >> 7
    return head + bytes([number])


def frame_to(node: int, data: bytes) -> can.Message:
    """A frame to a node, a reply wanted, padded to a length that CAN FD has."""
    length = next(n for n in _LENGTHS if n >= len(data))
    return can.Message(
        arbitration_id=REPLY_WANTED | HOST << 8 | node,
        is_extended_id=True,
        is_fd=True,
        bitrate_switch=True,
        data=data + bytes([NOP]) * (length - len(data)),
        is_rx=False,
    )


def framed(message: can.Message) -> bool:
    """Whether a frame is CAN FD, and extended where its identifier needs it."""
    long = message.arbitration_id > 0x7FF
    return bool(message.is_fd and not message.is_error_frame and message.is_extended_id == long)


def replier(message: can.Message) -> int:
    """The node whose reply to this controller a frame is, -1 where it is none."""
    mine = framed(message) and message.arbitration_id & 0xFF == HOST
    return message.arbitration_id >> 8 if mine and message.arbitration_id < REPLY_WANTED else -1


def orders(message: can.Message, node: int) -> bool:
    """Whether a frame is a master's to a node or to all, by CAN FD or classic, and does not begin with a question."""
    long = (message.is_fd or message.is_extended_id) and not (message.is_error_frame or message.is_remote_frame)
    if not long or message.arbitration_id >= 1 << 16 or message.arbitration_id & 0xFF not in (node, BROADCAST):
        return False
    first = message.data[0] if message.data else NOP
    return not (READ_INT8 <= first < REPLY_INT8 or first in (STREAM_POLL, NOP))


def mode_write(mode: int) -> bytes:
    """Write the mode, which must come first."""
    return bytes((WRITE_INT8 | 1, MODE, mode))


def write(first: int, values: Sequence[float]) -> bytes:
    """Write one to three registers from `first` on."""
    return bytes((WRITE_FLOAT | len(values), *_varuint(first))) + struct.pack(f"<{len(values)}f", *values)


def read(first: int, count: int = 1) -> bytes:
    """Read one to three registers from `first` on."""
    return bytes((READ_FLOAT | count, *_varuint(first)))


QUERY: Final = read(MODE, 3) + read(FAULT_CODE) + read(WATCHDOG_TIMEOUT)
"""What every command asks back: mode, position, velocity, fault code, the watchdog that the command holds."""


def command(place_turns: float, rate_turns_s: float, torque_Nm: float, watchdog_s: float) -> bytes:
    """Position mode from `place_turns` on at `rate_turns_s`, worth something for `watchdog_s`, and `QUERY`."""
    aim = mode_write(POSITION_MODE) + write(COMMAND_POSITION, (place_turns, rate_turns_s))
    return aim + write(MAXIMUM_TORQUE, (torque_Nm,)) + write(WATCHDOG_TIMEOUT, (watchdog_s,)) + QUERY


def told(data: bytes) -> dict[int, float]:
    """The registers that a reply tells, as far as it can be read; integers unscaled."""
    found: dict[int, float] = {}
    at = 0
    while at < len(data) and data[at] != NOP:
        kind, count = data[at] & 0x3C, data[at] & 0x03
        at += 1
        if not REPLY_INT8 <= kind <= REPLY_FLOAT:
            break
        head: list[int] = []
        while len(head) < (1 if count else 2):
            number, at = _read_varuint(data, at)
            if number < 0:
                return found
            head.append(number)
        first, count = head[-1], count or head[0]
        form = (kind - REPLY_INT8) >> 2
        for k in range(count):
            if at + _SIZES[form] > len(data):
                return found
            found[first + k] = float(struct.unpack_from(_FORMATS[form], data, at)[0])
            at += _SIZES[form]
    return found


def _read_varuint(data: bytes, at: int) -> tuple[int, int]:
    """A number of at most five bytes and where it ends; -1 where it does not."""
    number = 0
    for k in range(5):
        if at + k >= len(data):
            break
        number |= (data[at + k] & 0x7F) << 7 * k
        if data[at + k] < 0x80:
            return number, at + k + 1
    return -1, len(data)
