"""The table `[moteus]`, a moteus' frames and faults. Source: the maker's reference of CAN protocol and registers."""

import struct
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import ClassVar, Final

import can

from hil.bus.wrapping import fd_frame
from hil.drives.table import CODES, NODE, TurningTable, faults_of
from hil.nodes.frame_map import TIME_TO_LIVE
from models.rigs.schema import key

MODE, POSITION, VELOCITY, TORQUE, HOME_STATE, FAULT_CODE = 0x00, 0x01, 0x02, 0x03, 0x0C, 0x0F  # of moteus' reference
VOLTAGE, TEMPERATURE, PATH_POSITION, PATH_VELOCITY = 0x0D, 0x0E, 0x38, 0x39  # the same
COMMAND_POSITION, COMMAND_VELOCITY, MAXIMUM_TORQUE, SET_OUTPUT_EXACT = 0x20, 0x21, 0x25, 0x131  # the same
WATCHDOG_TIMEOUT, VELOCITY_LIMIT, ACCELERATION_LIMIT = 0x27, 0x28, 0x29  # the same
HELD: Final = (COMMAND_POSITION, COMMAND_VELOCITY, WATCHDOG_TIMEOUT, VELOCITY_LIMIT, ACCELERATION_LIMIT)
"""The registers of a command that a drive reports back."""
UNLIMITED: Final = -1.0  # No limit of velocity or acceleration. A limit that is not written is the configuration's.
RELATIVE, ROTOR, OUTPUT = 0, 1, 2
"""Home states: position known relative to power-on, within a turn of the rotor, or at the output."""
STOPPED, FAULTED, ENABLING, POSITION_MODE, TIMED_OUT, ZERO_VELOCITY, BRAKE = 0, 1, 2, 10, 11, 12, 15
"""Modes; 2 to 4 lead to an operating one."""
WRITE, READ, REPLY = 0x00, 0x10, 0x20  # first byte of a subframe, without form and count
WRITE_ERROR, READ_ERROR = 0x30, 0x31  # the whole of it
STREAM_TO_SERVO, STREAM_FROM_SERVO, STREAM_POLL, NOP = 0x40, 0x41, 0x42, 0x50  # the same; the last one fills a frame
INT8, FLOAT = 0, 3  # forms of a register's value, of the four in `_FORMS`
_FORMS: Final = "bhif"  # as struct has them
REPLY_WANTED: Final = 0x8000  # bit of the identifier
HOST: Final = 0x7A  # our source number: no reply to it has an identifier of the catalogue
BROADCAST: Final = 0x7F  # node id
SESSION: Final = 202  # The can.prefix of a drive in use. It is volatile, so a rebooted drive has its own prefix again.
PREFIXES: Final = (0, SESSION)  # of identifiers that are read
_LENGTHS: Final = (*range(9), 12, 16, 20, 24, 32, 48, 64)  # bytes of CAN FD frames
FAULTS: Final = faults_of(CODES["moteus"]["faults"])
"""Fault codes of mode 1: name, and the catalogue's code. Codes from 96 on only report an active limit."""
WATCHDOG: Final = ("watchdog expired (mode 11, timeout)", TIME_TO_LIVE)


class MoteusTable(TurningTable):
    """`[moteus]`: the carriage is a moteus controller on CAN FD."""

    where = "moteus"
    fd: ClassVar[bool] = True
    node_id: int = key(NODE, 1, 1, 126)
    most_torque_N_m: float = key("maximum torque at its output", 0.5, 0.001, 100.0)

    def orders(self, message: can.Message) -> bool:
        """Any frame to this node or to all, CAN FD or classic, that does not begin with a query."""
        long = (message.is_fd or message.is_extended_id) and not (message.is_error_frame or message.is_remote_frame)
        mine = message.arbitration_id & 0xFF in (self.node_id, BROADCAST) and message.arbitration_id >> 16 in PREFIXES
        first = message.data[0] if message.data else NOP
        return bool(long and mine and not (READ <= first < REPLY or first in (STREAM_POLL, NOP)))

    def identifiers(self) -> tuple[frozenset[int], frozenset[int]]:
        """With its own can.prefix, and with that of a session."""
        sent, received = REPLY_WANTED | HOST << 8 | self.node_id, self.node_id << 8 | HOST
        both = [frozenset(prefix << 16 | identifier for prefix in PREFIXES) for identifier in (sent, received)]
        return both[0], both[1]


def frame_to(node: int, data: bytes, prefix: int = 0, least: int = 0) -> can.Message:
    """A frame to a node that asks for a reply, padded to a CAN FD length of at least `least` bytes."""
    return fd_frame(prefix << 16 | REPLY_WANTED | HOST << 8 | node, padded(data, least))


def padded(data: bytes, least: int = 0) -> bytes:
    """`data` padded with `NOP` to a CAN FD length of at least `least` bytes."""
    return data.ljust(next(n for n in _LENGTHS if n >= max(len(data), least)), bytes([NOP]))


def framed(message: can.Message) -> bool:
    """Whether a frame is CAN FD, and extended where its identifier needs it."""
    long = message.arbitration_id > 0x7FF
    return bool(message.is_fd and not message.is_error_frame and message.is_extended_id == long)


def replier(message: can.Message) -> int:
    """The node that replies to this controller by this frame, -1 for any other frame."""
    mine = framed(message) and message.arbitration_id >> 16 in PREFIXES and message.arbitration_id & 0xFF == HOST
    return message.arbitration_id >> 8 & 0x7F if mine and not message.arbitration_id & REPLY_WANTED else -1


def head(kind: int, form: int, first: int, count: int) -> bytes:
    short = count < 4
    return bytes((kind | form << 2 | count * short, *(() if short else (count,)))) + varuint(first)


def varuint(number: int) -> bytes:
    """A number in groups of seven bits, the lowest first."""
    groups = b""
    while number >= 0x80:
        groups, number = groups + bytes((number & 0x7F | 0x80,)), number >> 7
    return groups + bytes((number,))


def values_in(form: int, values: Sequence[float]) -> bytes:
    return struct.pack(f"<{len(values)}{_FORMS[form]}", *values)


def mode_write(mode: int) -> bytes:
    """Write the mode; it must be the first subframe."""
    return head(WRITE, INT8, MODE, 1) + bytes((mode,))


def write(first: int, values: Sequence[float]) -> bytes:
    return head(WRITE, FLOAT, first, len(values)) + values_in(FLOAT, values)


def read(first: int, count: int = 1) -> bytes:
    return head(READ, FLOAT, first, count)


QUERY: Final = read(MODE, 3) + read(FAULT_CODE) + read(COMMAND_POSITION, 2) + read(WATCHDOG_TIMEOUT, 3)
"""The query of every command: mode, position, velocity, fault code, and the drive's current command."""


def hold(watchdog_s: float) -> bytes:
    """Write the watchdog of a command, and that no limit of the configuration applies to it."""
    return write(WATCHDOG_TIMEOUT, (watchdog_s, UNLIMITED, UNLIMITED))


def command(place_turns: float, rate_turns_s: float, torque_Nm: float, watchdog_s: float) -> bytes:
    """Position mode from `place_turns` at `rate_turns_s`, valid for `watchdog_s`, and `QUERY`."""
    aim = mode_write(POSITION_MODE) + write(COMMAND_POSITION, (place_turns, rate_turns_s))
    return aim + write(MAXIMUM_TORQUE, (torque_Nm,)) + hold(watchdog_s) + QUERY


def stream(line: str) -> bytes:
    text = f"{line}\n".encode()
    return bytes((STREAM_TO_SERVO, 1, len(text))) + text


def single(value: float) -> float:
    """`value` rounded to 32 bits, as a drive reports it."""
    return float(struct.unpack("<f", struct.pack("<f", value))[0])


@dataclass(frozen=True)
class Part:
    """One subframe; `count` is that of values, of queried registers or bytes, or the number of an error."""

    kind: int
    first: int = 0
    count: int = 0
    form: int = 0
    values: tuple[float, ...] = ()
    text: bytes = b""


def parts(data: bytes) -> Iterator[Part]:
    """The subframes of a frame, in order. Raises IndexError, ValueError or struct.error if one is unreadable."""
    at = 0
    while at < len(data):
        kind, at = data[at], at + 1
        if kind == NOP:
            continue
        if kind in (STREAM_TO_SERVO, STREAM_FROM_SERVO):
            channel, length = data[at], data[at + 1]
            yield Part(kind, channel, text=data[at + 2 : at + 2 + length])
            at += 2 + length
        elif kind == STREAM_POLL:
            yield Part(kind, data[at], data[at + 1])
            at += 2
        elif kind in (WRITE_ERROR, READ_ERROR):
            first, at = _varuint(data, at)
            code, at = _varuint(data, at)
            yield Part(kind, first, code)
        elif kind < WRITE_ERROR:
            count, form = kind & 3, kind >> 2 & 3
            if not count:
                count, at = _varuint(data, at)
            first, at = _varuint(data, at)
            raw = f"<{count}{_FORMS[form]}" if kind & 0x30 != READ else "<"
            yield Part(kind & 0x30, first, count, form, struct.unpack_from(raw, data, at))
            at += struct.calcsize(raw)
        else:
            raise ValueError(f"subframe must be a known one; got {kind:#x}")


def _varuint(data: bytes, at: int) -> tuple[int, int]:
    number = 0
    for k in range(5):
        number |= (data[at + k] & 0x7F) << 7 * k
        if data[at + k] < 0x80:
            return number, at + k + 1
    raise ValueError("a number must have at most five bytes")


def reported(data: bytes) -> dict[int, float]:
    """The registers in a reply, as far as it is readable; integers unscaled. Never raises."""
    found: dict[int, float] = {}
    with suppress(IndexError, ValueError, struct.error):
        for part in parts(data):
            if part.kind == REPLY:
                found |= {part.first + k: float(value) for k, value in enumerate(part.values)}
            elif part.kind not in (WRITE_ERROR, READ_ERROR):
                break
    return found
