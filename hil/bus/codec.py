"""Values to bytes and back; for speed a frame is one little-endian integer."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from hil.bus.catalogue import Frame
from models.parameter import nearest

Reason = Literal["length", "range", "crc", "counter", "repeated", "unknown"]


class FrameError(ValueError):
    """Values that do not fit their frame: out of range, not finite, missing or unknown."""


@dataclass(frozen=True, slots=True)
class Refusal:
    reason: Reason
    detail: str = ""


class Codec:
    """One frame's codec, without protection: `round((value - offset)/scale)`, ties to even; unused bits are 0."""

    __slots__ = ("_reading", "_writing", "frame", "length")

    def __init__(self, frame: Frame) -> None:
        self.frame, self.length = frame, frame.length
        self._writing = tuple(
            (f.name, f.lower, f.upper, f.offset, f.scale, f.raw_lower, f.raw_upper, (1 << f.length) - 1, f.start)
            for f in frame.fields
        )
        bits = {f.name: ((1 << f.length) - 1, 1 << (f.length - 1) if f.signed else 0) for f in frame.fields}
        self._reading = tuple(
            (f.name, f.start, *bits[f.name], f.scale, f.offset, f.raw_lower, f.raw_upper, frozenset(f.names))
            for f in frame.fields
        )

    def encode(self, values: Mapping[str, float]) -> int:
        """The values of all signals as the frame's integer, with CRC and counter 0. Raises FrameError."""
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
        """The values of all signals in the frame's integer, or the refusal. Never raises."""
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
        for name in values:
            if name not in names:
                hint = nearest(str(name), names)
                return FrameError(f"{self.frame.name} must get its own signals; got {name!r}; {hint}")
        missing = next(name for name in names if name not in values)
        return FrameError(f"{self.frame.name} must get all its signals; {missing!r} is missing")


NO_SURPRISE: Final = -10.0  # the value on the wire for "none"
NOT_MEASURED_C: Final = -40.0  # the same for a temperature
_SENSOR: Final = ("Valid", 0.0)  # signal and value of a sensor's frame without a measurement
_FLAGS: Final[Mapping[str, tuple[tuple[str, float], tuple[str, ...]]]] = {
    "CapsuleLocalisation": (_SENSOR, ("Position_m", "Quality", "Age_s")),
    "ForceReading": (_SENSOR, ("Force_N", "Age_s")),
    "BelievedMotion": (("Wall", 3.0), ("Position_m", "Std_m", "Surprise")),
    "ModelHealth": (("State", 3.0), ("Since_s", "Evidence")),
}
"""By frame: the flag without a measurement, and the signals that are then empty."""
_VALUES: Final[Mapping[str, float]] = {"Surprise": NO_SURPRISE, "Temperature_degC": NOT_MEASURED_C}
"""By signal: the value for "none"."""


def without_absent(frame: str, values: Mapping[str, float]) -> dict[str, float]:
    """The signals of `frame`, NaN for those without a value."""
    (flag, absent), empty = _FLAGS.get(frame, (("", 0.0), ()))
    none = empty if values.get(flag) == absent else ()
    return {name: math.nan if name in none or value == _VALUES.get(name) else value for name, value in values.items()}
