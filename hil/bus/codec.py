"""Values to bytes and back, as fast as Python's integers: a frame is one little-endian number."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from hil.bus.catalogue import Field, Frame
from models.parameter import nearest

Reason = Literal["length", "range", "crc", "counter", "repeated", "unknown"]
PAYLOAD = 12  # bits of a frame that its protection takes: CRC and counter


class FrameError(ValueError):
    """What was to be sent does not fit its frame: a value out of range, not finite, missing or unknown."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a received frame changes nothing."""

    reason: Reason
    detail: str = ""


class Codec:
    """One frame's codec, without protection: `round((value - offset)/scale)`, ties to even; unowned bits are 0."""

    __slots__ = ("_reading", "_writing", "frame", "length")

    def __init__(self, frame: Frame) -> None:
        self.frame, self.length = frame, frame.length
        self._writing = tuple(
            (f.name, f.lower, f.upper, f.offset, f.scale, f.raw_lower, f.raw_upper, (1 << f.length) - 1, f.start)
            for f in frame.fields
        )
        self._reading = tuple(_reading(f) for f in frame.fields)

    def encode(self, values: Mapping[str, float]) -> int:
        """`values` of every signal as the frame's number, CRC and counter 0. Raises FrameError."""
        if len(values) != len(self._writing):
            raise self._misfit(values)
        bits = 0
        for name, lower, upper, offset, scale, raw_lower, raw_upper, mask, start in self._writing:
            try:
                value = values[name]
                if not lower <= value <= upper:
                    raise FrameError(f"{self.frame.name} {name} must lie in [{lower:g}, {upper:g}]; got {value!r}")
                raw = round((value - offset) / scale)
            except KeyError:
                raise self._misfit(values) from None
            except TypeError:
                raise FrameError(f"{self.frame.name} {name} must be a number; got {values[name]!r}") from None
            bits |= (min(max(raw, raw_lower), raw_upper) & mask) << start
        return bits

    def decode(self, bits: int) -> dict[str, float] | Refusal:
        """The values of all signals of the frame's number, or why it is refused. Never raises."""
        values = {}
        for name, start, mask, sign, scale, offset, raw_lower, raw_upper, known in self._reading:
            raw = (bits >> start) & mask
            if raw & sign:
                raw -= mask + 1
            if not raw_lower <= raw <= raw_upper or (known and raw not in known):
                return Refusal("range", f"{self.frame.name} {name} raw {raw}")
            values[name] = raw * scale + offset
        return values

    def _misfit(self, values: Mapping[str, float]) -> FrameError:
        names = [f.name for f in self.frame.fields]
        unknown = [name for name in values if name not in names]
        if unknown:
            return FrameError(
                f"{self.frame.name} must get its own signals; got {unknown[0]!r}; {nearest(str(unknown[0]), names)}"
            )
        missing = next(name for name in names if name not in values)
        return FrameError(f"{self.frame.name} must get all its signals; {missing!r} is missing")


def _reading(f: Field) -> tuple[str, int, int, int, float, float, int, int, frozenset[int]]:
    sign = 1 << (f.length - 1) if f.signed else 0
    return f.name, f.start, (1 << f.length) - 1, sign, f.scale, f.offset, f.raw_lower, f.raw_upper, frozenset(f.names)


NO_SURPRISE: Final = -10.0  # a value on the wire that says that there is none
NOT_MEASURED_C: Final = -40.0  # the same of a temperature
_SENSOR: Final = ("Valid", 0.0)  # signal and value by which a sensor's frame says that it says nothing
_FLAGS: Final[Mapping[str, tuple[tuple[str, float], tuple[str, ...]]]] = {
    "CapsuleLocalisation": (_SENSOR, ("Position_m", "Quality", "Age_s")),
    "ForceReading": (_SENSOR, ("Force_N", "Age_s")),
    "BelievedMotion": (("Wall", 3.0), ("Position_m", "Std_m", "Surprise")),
    "ModelHealth": (("State", 3.0), ("Since_s", "Evidence")),
}
"""Frame: the flag that says so, and what then says nothing."""
_VALUES: Final[Mapping[str, float]] = {"Surprise": NO_SURPRISE, "Temperature_degC": NOT_MEASURED_C}
"""Signal: the value that stands for none."""


def without_absent(frame: str, values: Mapping[str, float]) -> dict[str, float]:
    """The signals of `frame`, NaN where they say nothing."""
    (flag, said), silent = _FLAGS.get(frame, (("", 0.0), ()))
    none = set(silent) if values.get(flag) == said and silent else set[str]()
    return {name: math.nan if name in none or value == _VALUES.get(name) else value for name, value in values.items()}
