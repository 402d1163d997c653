"""The frames as `capsule.dbc` describes them, read with cantools and checked, as plain records."""

import binascii
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import cantools
from cantools.database import Database

from models.parameter import nearest

DBC = Path(__file__).parents[1] / "capsule.dbc"
CRC, COUNTER = "CRC", "Counter"
SEND_TYPES = ("Cyclic", "Event", "IfActive")  # every cycle; twice on an event; every cycle while what it says holds
_ROUNDING = 1e-9  # of a raw value
_LARGEST_DBC = 1 << 22  # bytes


@dataclass(frozen=True, slots=True)
class Field:
    """One signal, little endian: value = raw `scale` + `offset` within [`lower`, `upper`]; `names` of its numbers."""

    name: str
    start: int
    length: int
    signed: bool
    scale: float
    offset: float
    lower: float
    upper: float
    raw_lower: int
    raw_upper: int
    unit: str
    comment: str
    names: Mapping[int, str]

    def number(self, name: str) -> int:
        """The raw number that stands for `name`; a ValueError names the nearest one."""
        for raw, known in self.names.items():
            if known == name:
                return raw
        raise ValueError(
            f"{self.name} must be one of its names; got {name!r}; {nearest(name, list(self.names.values()))}"
        )


@dataclass(frozen=True, slots=True)
class Frame:
    """One message: how it is `sent`, the `data_id` of its protection, its signals but CRC and counter."""

    name: str
    id: int
    length: int
    sender: str
    receivers: tuple[str, ...]
    cycle_s: float
    sent: str
    data_id: int
    fields: tuple[Field, ...]
    comment: str

    def field(self, name: str) -> Field:
        """The signal `name`; a ValueError names the nearest one."""
        for one in self.fields:
            if one.name == name:
                return one
        raise ValueError(
            f"signal must be one of {self.name}; got {name!r}; {nearest(name, [f.name for f in self.fields])}"
        )


@dataclass(frozen=True)
class FrameCatalogue:
    """All frames by name, the bit rate in bit/s, and the `fingerprint` of what they mean, which heartbeats carry."""

    frames: Mapping[str, Frame]
    bit_rate: int
    fingerprint: int
    source: str

    def __getitem__(self, name: str) -> Frame:
        if name not in self.frames:
            raise ValueError(
                f"{self.source}: frame must be one of the catalogue; got {name!r}; {nearest(name, dict(self.frames))}"
            )
        return self.frames[name]

    def by_id(self) -> dict[int, Frame]:
        return {frame.id: frame for frame in self.frames.values()}


@cache
def load_catalogue(path: Path = DBC) -> FrameCatalogue:
    """Read a DBC file. Raises ValueError of one sentence where it cannot be read, or a frame is not protected: 11-bit
    identifier, little endian, no multiplexing, 8-bit CRC first, then a 4-bit counter, a data id of its own.
    """
    try:
        if path.stat().st_size > _LARGEST_DBC:
            raise ValueError(f"{path}: DBC must be smaller than {_LARGEST_DBC} bytes; got {path.stat().st_size}")
        text = path.read_bytes().decode("utf-8")
        database = cantools.database.load_string(text, "dbc", strict=True)
    except OSError as error:
        raise ValueError(f"{path}: DBC must be a file that can be read; got: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: DBC must be UTF-8 text; got another byte at {error.start}") from None
    except cantools.Error as error:
        raise ValueError(
            f"{path}: DBC must be one that cantools reads; got: {' '.join(str(error).split())[:200]}"
        ) from None
    if not isinstance(database, Database):
        raise ValueError(f"{path}: DBC must describe CAN messages; got a {type(database).__name__}")
    frames = {message.name: _frame(message, str(path)) for message in database.messages}
    _refuse_doubles(frames, str(path))
    attributes: Any = database.dbc.attributes if database.dbc else {}
    rate = int(attributes["Baudrate"].value) if "Baudrate" in attributes else 0
    if not 10_000 <= rate <= 1_000_000:
        raise ValueError(
            f"{path}: attribute Baudrate must be a rate of classic CAN, 10000 to 1000000 bit/s; got {rate}"
        )
    return FrameCatalogue(MappingProxyType(frames), rate, fingerprint_of(frames, rate), str(path))


def fingerprint_of(frames: Mapping[str, Frame], bit_rate: int) -> int:
    """CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xFFFF, not reflected, not inverted; 0x29B1 for "123456789") of
    `meaning`: comments, units, senders, line ends and the order of the file do not count.
    """
    return binascii.crc_hqx(meaning(frames, bit_rate).encode("ascii", "backslashreplace"), 0xFFFF)


def meaning(frames: Mapping[str, Frame], bit_rate: int) -> str:
    """What nodes must agree on, a line each, ended by a line feed, numbers as C's `%.9g`: `bus RATE`, then for each
    frame in order of its identifier `frame ID NAME LENGTH CYCLE_MS SENT DATA_ID`, for each of its signals (CRC and
    counter left out) in order of its first bit `signal NAME START LENGTH u|s FACTOR OFFSET LOWER UPPER`, and for each
    of that signal's named numbers, from the least on, `value NUMBER NAME`.
    """
    lines = [f"bus {bit_rate}"]
    for frame in sorted(frames.values(), key=lambda f: f.id):
        cycle_ms = round(1e3 * frame.cycle_s)
        lines.append(f"frame {frame.id} {frame.name} {frame.length} {cycle_ms} {frame.sent} {frame.data_id}")
        for one in sorted(frame.fields, key=lambda f: f.start):
            sign = "s" if one.signed else "u"
            numbers = " ".join(f"{number:.9g}" for number in (one.scale, one.offset, one.lower, one.upper))
            lines.append(f"signal {one.name} {one.start} {one.length} {sign} {numbers}")
            lines += [f"value {raw} {name}" for raw, name in sorted(one.names.items())]
    return "".join(line + "\n" for line in lines)


def _frame(message: Any, where: str) -> Frame:
    what = f"{where}: frame {message.name}"
    if message.is_extended_frame or message.is_fd or message.is_multiplexed():
        raise ValueError(
            f"{what} must be a plain frame with an 11-bit identifier; got an extended, FD or multiplexed one"
        )
    signals = {signal.name: signal for signal in message.signals}
    for name, start, length in ((CRC, 0, 8), (COUNTER, 8, 4)):
        signal = signals.pop(name, None)
        if signal is None or (signal.start, signal.length, signal.is_signed) != (start, length, False):
            raise ValueError(f"{what} must have an unsigned signal {name} of {length} bits at bit {start}; it has none")
    attributes = message.dbc.attributes if message.dbc else {}
    data_id = int(attributes["DataId"].value) if "DataId" in attributes else 0
    if not 1 <= data_id <= 255:
        raise ValueError(f"{what} must have an attribute DataId from 1 to 255; got {data_id}")
    sent = SEND_TYPES[int(attributes["GenMsgSendType"].value)] if "GenMsgSendType" in attributes else "Cyclic"
    if (sent == "Event") == bool(message.cycle_time):
        raise ValueError(
            f"{what} must have a cycle time, unless it is sent on an event; got {message.cycle_time} ms and {sent}"
        )
    return Frame(
        message.name,
        message.frame_id,
        message.length,
        message.senders[0] if message.senders else "",
        tuple(sorted(message.receivers)),
        (message.cycle_time or 0) / 1000,
        sent,
        data_id,
        tuple(_field(signal, what) for signal in signals.values()),
        message.comment or "",
    )


def _field(signal: Any, what: str) -> Field:
    if signal.byte_order != "little_endian" or signal.is_float:
        raise ValueError(f"{what}: signal {signal.name} must be a little-endian integer; got another kind")
    scale, offset = float(signal.scale), float(signal.offset)
    least = -(1 << (signal.length - 1)) if signal.is_signed else 0
    most = least + (1 << signal.length) - 1
    if signal.minimum is None or signal.maximum is None or not scale > 0:
        raise ValueError(f"{what}: signal {signal.name} must have a range and a positive factor; it lacks one of them")
    lower, upper = float(signal.minimum), float(signal.maximum)
    raw_lower = math.ceil((lower - offset) / scale - _ROUNDING)
    raw_upper = math.floor((upper - offset) / scale + _ROUNDING)
    if not least <= raw_lower <= raw_upper <= most:
        raise ValueError(
            f"{what}: range of {signal.name} must fit its {signal.length} bits; got [{lower:g}, {upper:g}]"
        )
    names = MappingProxyType({int(raw): str(name) for raw, name in (signal.choices or {}).items()})
    numbers = (signal.start, signal.length, signal.is_signed, scale, offset, lower, upper, raw_lower, raw_upper)
    return Field(signal.name, *numbers, signal.unit or "", signal.comment or "", names)


def _refuse_doubles(frames: Mapping[str, Frame], where: str) -> None:
    seen: dict[int, str] = {}
    for frame in frames.values():
        if frame.data_id in seen:
            raise ValueError(
                f"{where}: DataId must be a frame's own; got {frame.data_id} for {seen[frame.data_id]} and {frame.name}"
            )
        seen[frame.data_id] = frame.name
