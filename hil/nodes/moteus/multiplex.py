"""The frames of a moteus controller as its firmware reads and writes them: apart from `registers`, which is the
controller's side, so that each shows the other's mistakes.
"""

import math
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

WRITE, READ, LINE, POLL = "write", "read", "line", "poll"
UNKNOWN, READ_ONLY = 1, 2
"""Error numbers of a register."""
_SIZES: Final = (1, 2, 4, 4)  # bytes of int8, int16, int32 and float
_KINDS: Final = ("b", "h", "i", "f")
_FLOAT: Final = 3  # the fourth of these
# scale of int8, int16 and int32, of moteus' reference
_POSITION, _VELOCITY, _ACCELERATION = (0.01, 1e-4, 1e-5), (0.1, 0.00025, 1e-5), (0.05, 0.001, 1e-5)
# the same
_TORQUE, _TIME, _VOLTAGE, _TEMPERATURE = (0.5, 0.01, 0.001), (0.01, 0.001, 1e-6), (0.5, 0.1, 0.001), (1.0, 0.1, 0.001)
_SCALES: Final = {
    **dict.fromkeys((0x01, 0x20, 0x26, 0x38, 0x130, 0x131), _POSITION),
    **dict.fromkeys((0x02, 0x21, 0x28, 0x39), _VELOCITY),
    **dict.fromkeys((0x03, 0x22, 0x25), _TORQUE),
    0x0D: _VOLTAGE,
    0x0E: _TEMPERATURE,
    0x27: _TIME,
    0x29: _ACCELERATION,
}
"""What one step of int8, int16 and int32 is worth; 1 where a register is a whole number."""


@dataclass(frozen=True)
class Part:
    """One subframe: registers from `first` on with their values, or how many are asked for in `form` (int8, int16,
    int32, float: 0 to 3); a line of the diagnostic stream, or a question for at most `count` bytes of it.
    """

    kind: str
    first: int = 0
    count: int = 0
    form: int = 0
    values: tuple[float, ...] = ()
    text: bytes = b""


def parts(data: bytes) -> Iterator[Part]:
    """The subframes of a frame, in order. Raises IndexError, ValueError or struct.error where it cannot be read."""
    at = 0
    while at < len(data):
        kind, at = data[at], at + 1
        if kind == 0x50:
            continue
        if kind == 0x40:
            yield Part(LINE, text=data[at + 2 : at + 2 + data[at + 1]])
            at += 2 + data[at + 1]
        elif kind == 0x42:
            yield Part(POLL, first=data[at], count=data[at + 1])
            at += 2
        elif kind < 0x20:
            count, form = kind & 3, kind >> 2 & 3
            if not count:
                count, at = _varuint(data, at)
            first, at = _varuint(data, at)
            if kind >= 0x10:
                yield Part(READ, first, count, form)
                continue
            raw = struct.unpack_from(f"<{count}{_KINDS[form]}", data, at)
            yield Part(WRITE, first, count, form, tuple(_value(first + k, form, v) for k, v in enumerate(raw)))
            at += count * _SIZES[form]
        else:
            raise ValueError(f"subframe {kind:#x} is none that a drive takes")


def answer(part: Part, register: Callable[[int], float | None]) -> tuple[bytes, bool]:
    """The reply to a question for registers, and whether there are all of them: an error in its place where not, after
    which nothing more of the frame is read.
    """
    values: list[float] = []
    for number in range(part.first, part.first + part.count):
        value = register(number)
        if value is None:
            return error(0x31, number, UNKNOWN), False
        values.append(value)
    return _reply(part, values), True


def error(kind: int, number: int, code: int) -> bytes:
    """That a register was not written (0x30) or read (0x31)."""
    return bytes((kind, *_number(number), code))


def _reply(part: Part, values: list[float]) -> bytes:
    if not values:
        return b""
    short = len(values) < 4
    head = bytes((0x20 | part.form << 2 | (len(values) if short else 0), *(() if short else (len(values),))))
    raw = [_raw(part.first + k, part.form, value) for k, value in enumerate(values)]
    return head + _number(part.first) + struct.pack(f"<{len(values)}{_KINDS[part.form]}", *raw)


def _value(number: int, form: int, raw: float) -> float:
    if form == _FLOAT:
        return raw
    lowest = -(1 << 8 * _SIZES[form] - 1)
    return math.nan if raw == lowest else raw * _SCALES.get(number, (1.0, 1.0, 1.0))[form]


def _raw(number: int, form: int, value: float) -> float:
    if form == _FLOAT:
        return value
    most = (1 << 8 * _SIZES[form] - 1) - 1
    if math.isnan(value):
        return -most - 1
    return round(min(max(value / _SCALES.get(number, (1.0, 1.0, 1.0))[form], -most), most))


def _varuint(data: bytes, at: int) -> tuple[int, int]:
    number = 0
    for k in range(5):
        number |= (data[at + k] & 0x7F) << 7 * k
        if data[at + k] < 0x80:
            return number, at + k + 1
    raise ValueError("a number must have at most five bytes")


def _number(number: int) -> bytes:
    head = b""
    while number >= 0x80:
        head, number = head + bytes((number & 0x7F | 0x80,)), number >> 7
    return head + bytes((number,))
