"""moteus frames: registers written, read and told, all as floats but the mode that is written. Source: the maker's
description of its CAN protocol and registers.
"""

import struct
from collections.abc import Sequence
from typing import Final

import can

from hil.bus.wrapping import fd_frame

MODE, POSITION, VELOCITY, HOME_STATE, FAULT_CODE = 0x00, 0x01, 0x02, 0x0C, 0x0F  # registers of moteus' reference
COMMAND_POSITION, COMMAND_VELOCITY, MAXIMUM_TORQUE, SET_OUTPUT_EXACT = 0x20, 0x21, 0x25, 0x131  # the same
WATCHDOG_TIMEOUT, VELOCITY_LIMIT, ACCELERATION_LIMIT = 0x27, 0x28, 0x29  # the same
HELD: Final = (COMMAND_POSITION, COMMAND_VELOCITY, WATCHDOG_TIMEOUT, VELOCITY_LIMIT, ACCELERATION_LIMIT)
"""What of a command a drive tells back."""
UNLIMITED: Final = -1.0
"""As a velocity or acceleration limit: none. What is not written has the limit of the drive's configuration."""
RELATIVE, ROTOR, OUTPUT = 0, 1, 2
"""Home states: the place is known from where the drive was switched on, within a turn of the rotor, at the output."""
STOPPED, FAULTED, POSITION_MODE, TIMED_OUT, BRAKE = 0, 1, 10, 11, 15
"""Modes; 2 to 4 are on the way to one that operates."""
# first bytes of a subframe
WRITE_INT8, WRITE_FLOAT, READ_INT8, READ_FLOAT, REPLY_INT8, REPLY_FLOAT = 0x00, 0x0C, 0x10, 0x1C, 0x20, 0x2C
WRITE_ERROR, READ_ERROR = 0x30, 0x31  # the same
STREAM_TO_SERVO, STREAM_FROM_SERVO, STREAM_POLL = 0x40, 0x41, 0x42  # the same
REPLY_WANTED: Final = 0x8000  # bit of the identifier
HOST: Final = 0x7A
"""The controller's number as a source: no reply to it has an identifier of the catalogue."""
BROADCAST: Final = 0x7F  # node id
SESSION: Final = 202
"""The can.prefix of a drive that is led. It is set in the drive's memory alone, so one that has booted anew has its own
again, and what is still under way to the one that was led is not for it.
"""
PREFIXES: Final = (0, SESSION)  # of identifiers that are read
NOP: Final = 0x50  # fills a frame
_LENGTHS: Final = (*range(9), 12, 16, 20, 24, 32, 48, 64)  # bytes of CAN FD frames
_SIZES: Final = (1, 2, 4, 4)  # bytes of int8, int16, int32 and float
_FORMATS: Final = ("<b", "<h", "<i", "<f")


def _varuint(number: int) -> bytes:
    head = b""
    while number >= 0x80:
        head, number = head + bytes([number & 0x7F | 0x80]), number >> 7
    return head + bytes([number])


def frame_to(node: int, data: bytes, prefix: int = 0, least: int = 0) -> can.Message:
    """A frame to a node, a reply wanted, padded to a length that CAN FD has, of at least `least` bytes."""
    return fd_frame(prefix << 16 | REPLY_WANTED | HOST << 8 | node, padded(data, least))


def padded(data: bytes, least: int = 0) -> bytes:
    """`data` with as many `NOP` as make a length that CAN FD has, of at least `least` bytes."""
    return data.ljust(next(n for n in _LENGTHS if n >= max(len(data), least)), bytes([NOP]))


def framed(message: can.Message) -> bool:
    """Whether a frame is CAN FD, and extended where its identifier needs it."""
    long = message.arbitration_id > 0x7FF
    return bool(message.is_fd and not message.is_error_frame and message.is_extended_id == long)


def replier(message: can.Message) -> int:
    """The node whose reply to this controller a frame is, -1 where it is none."""
    mine = framed(message) and message.arbitration_id >> 16 in PREFIXES and message.arbitration_id & 0xFF == HOST
    return message.arbitration_id >> 8 & 0x7F if mine and not message.arbitration_id & REPLY_WANTED else -1


def orders(message: can.Message, node: int) -> bool:
    """Whether a frame is a master's to a node or to all, by CAN FD or classic, and does not begin with a question."""
    long = (message.is_fd or message.is_extended_id) and not (message.is_error_frame or message.is_remote_frame)
    mine = message.arbitration_id >> 16 in PREFIXES and message.arbitration_id & 0xFF in (node, BROADCAST)
    if not long or not mine:
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


QUERY: Final = read(MODE, 3) + read(FAULT_CODE) + read(COMMAND_POSITION, 2) + read(WATCHDOG_TIMEOUT, 3)
"""What every command asks back: mode, position, velocity, fault code, and the command that the drive holds."""


def hold(watchdog_s: float) -> bytes:
    """Write how long a command is worth something, and that it goes by no limit of the drive's own."""
    return write(WATCHDOG_TIMEOUT, (watchdog_s, UNLIMITED, UNLIMITED))


def command(place_turns: float, rate_turns_s: float, torque_Nm: float, watchdog_s: float) -> bytes:
    """Position mode from `place_turns` on at `rate_turns_s`, worth something for `watchdog_s`, and `QUERY`."""
    aim = mode_write(POSITION_MODE) + write(COMMAND_POSITION, (place_turns, rate_turns_s))
    return aim + write(MAXIMUM_TORQUE, (torque_Nm,)) + hold(watchdog_s) + QUERY


def stream(line: str) -> bytes:
    """A line for the drive's diagnostic stream."""
    text = f"{line}\n".encode()
    return bytes((STREAM_TO_SERVO, 1, len(text))) + text


def single(value: float) -> float:
    """`value` as a float of 32 bits, as it comes back."""
    return float(struct.unpack("<f", struct.pack("<f", value))[0])


def told(data: bytes) -> dict[int, float]:
    """The registers that a reply tells, as far as it can be read; integers unscaled. Registers that the drive does not
    know are not there.
    """
    found: dict[int, float] = {}
    at = 0
    while at < len(data) and data[at] != NOP:
        kind, count, unknown = data[at] & 0xFC, data[at] & 0x03, data[at] in (WRITE_ERROR, READ_ERROR)
        at += 1
        if unknown:
            _, at = _read_varuint(data, at)
            _, at = _read_varuint(data, at)
            continue
        if not REPLY_INT8 <= kind <= REPLY_FLOAT:
            break
        if not count:
            count, at = _read_varuint(data, at)
        first, at = _read_varuint(data, at) if count else (0, at)
        if min(count, first) < 0:
            return found
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
