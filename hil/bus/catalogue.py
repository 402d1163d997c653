"""The frames of `capsule.dbc`, read with cantools and checked, as plain records."""

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
SEND_TYPES = ("Cyclic", "Event", "IfActive")  # every cycle; twice per event; every cycle while its content is true
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
        """The raw number for `name`; a ValueError has the nearest name."""
        numbers = {known: raw for raw, known in self.names.items()}
        if name not in numbers:
            raise ValueError(f"{self.name} must be one of its names; got {name!r}; {nearest(name, list(numbers))}")
        return numbers[name]


@dataclass(frozen=True, slots=True)
class Frame:
    """One message: `sent` of `SEND_TYPES`, `data_id` of its protection, its signals except CRC and counter."""

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
        """The signal `name`; a ValueError has the nearest name."""
        known = {one.name: one for one in self.fields}
        if name not in known:
            raise ValueError(f"signal must be one of {self.name}; got {name!r}; {nearest(name, list(known))}")
        return known[name]


@dataclass(frozen=True)
class FrameCatalogue:
    """All frames by name, the bit rate in bit/s, and the `fingerprint` of their meaning, which heartbeats contain."""

    frames: Mapping[str, Frame]
    bit_rate: int
    fingerprint: int
    source: str

    def __getitem__(self, name: str) -> Frame:
        if name not in self.frames:
            hint = nearest(name, dict(self.frames))
            raise ValueError(f"{self.source}: frame must be one of the catalogue; got {name!r}; {hint}")
        return self.frames[name]

    def by_id(self) -> dict[int, Frame]:
        return {frame.id: frame for frame in self.frames.values()}


@cache
def load_catalogue(path: Path = DBC) -> FrameCatalogue:
    """Read a DBC file. Raises ValueError of one sentence if it cannot be read, or if a frame is not of our form: 11-bit
    identifier, little endian, no multiplexing, 8-bit CRC first, then a 4-bit counter, a unique data id.
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
        got = " ".join(str(error).split())[:200]
        raise ValueError(f"{path}: DBC must be one that cantools reads; got: {got}") from None
    if not isinstance(database, Database):
        raise ValueError(f"{path}: DBC must describe CAN messages; got a {type(database).__name__}")
    frames: dict[str, Frame] = {}
    owners: dict[int, str] = {}
    for message in database.messages:
        frames[message.name] = frame = _frame(message, str(path))
        owner = owners.setdefault(frame.data_id, frame.name)
        if owner != frame.name:
            got = f"{frame.data_id} for {owner} and {frame.name}"
            raise ValueError(f"{path}: DataId must be a frame's own; got {got}")
    attributes: Any = database.dbc.attributes if database.dbc else {}
    rate = int(attributes["Baudrate"].value) if "Baudrate" in attributes else 0
    if not 10_000 <= rate <= 1_000_000:
        raise ValueError(f"{path}: attribute Baudrate must be that of classic CAN, 10000 to 1000000 bit/s; got {rate}")
    fingerprint = binascii.crc_hqx(meaning(frames, rate).encode("ascii", "backslashreplace"), 0xFFFF)
    return FrameCatalogue(MappingProxyType(frames), rate, fingerprint, str(path))


def meaning(frames: Mapping[str, Frame], bit_rate: int) -> str:
    """The text on which nodes must agree. Its CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xFFFF, not reflected, not
    inverted; 0x29B1 for "123456789") is the fingerprint; comments, units, senders and the order of the file have no
    effect.

    Lines end with a line feed, numbers are written as C's `%.9g`: `bus RATE`, then for each frame by identifier
    `frame ID NAME LENGTH CYCLE_MS SENT DATA_ID`, for each of its signals (without CRC and counter) by first bit
    `signal NAME START LENGTH u|s FACTOR OFFSET LOWER UPPER`, for each of its named numbers, the least first,
    `value NUMBER NAME`.
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
        raise ValueError(f"{what} must be classic with an 11-bit identifier; got an extended, FD or multiplexed one")
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
        got = f"{message.cycle_time} ms and {sent}"
        raise ValueError(f"{what} must have a cycle time, unless it is sent on an event; got {got}")
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
        got = f"[{lower:g}, {upper:g}]"
        raise ValueError(f"{what}: range of {signal.name} must fit its {signal.length} bits; got {got}")
    names = MappingProxyType({int(raw): str(name) for raw, name in (signal.choices or {}).items()})
    numbers = (signal.start, signal.length, signal.is_signed, scale, offset, lower, upper, raw_lower, raw_upper)
    return Field(signal.name, *numbers, signal.unit or "", signal.comment or "", names)
