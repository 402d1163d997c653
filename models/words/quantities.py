"""One rule for numbers that people read, on terminal, pages and plots: digits from the interval where there is one,
units with prefixes, powers of ten as such, no sign before a zero.
"""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

DASH: Final = "–"
_MINUS: Final = "−"
_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PREFIXES: Final = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))  # of SI
_PREFIXED: Final = frozenset({"m", "s", "N", "Pa", "A", "V", "m/s", "J", "W", "rad", "N/m", "m/N", "N at 10 mm/s"})
_NEVER_LARGE: Final = frozenset({"s", "m", "m/s", "rad"})
_WRITTEN: Final = MappingProxyType({"1": "", "deg": "°", "Ohm": "Ω"})
_POWER: Final = re.compile(r"(?<=[A-Za-z])\^?([23])(?![0-9])")
_IN_WORDS: Final = frozenset({"at", "of", "or", "the", "log10"})
LEAST_PERCENT: Final = 0.01
"""Per cent below which a share is printed as less than this."""
PLAIN: Final = (1e-4, 1e6)
"""Sizes that are written without a power of ten."""


def plain(value: Any) -> Any:
    """Dicts, sequences, NumPy numbers and arrays as JSON has them; a number that is not finite becomes None."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def number(value: float | None, digits: int = 4) -> str:
    """A number with so many significant digits; a dash where there is none."""
    if value is None or math.isnan(value):
        return DASH
    if math.isinf(value):
        return "∞" if value > 0 else f"{_MINUS}∞"
    if value == 0:
        return "0"
    places = digits - 1 - _exponent(value, digits)
    if PLAIN[0] <= abs(value) < PLAIN[1]:
        text = f"{round(value, places):.{max(places, 0)}f}"
        return _signed(text.rstrip("0").rstrip(".") if "." in text else text)
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    return _signed(f"{mantissa}·10{str(int(exponent)).translate(_RAISED)}")


def fixed(value: float | None, places: int) -> str:
    """A number with so many places behind the point, which may be negative; never "-0"."""
    if value is None or not math.isfinite(value):
        return number(value)
    text = f"{round(value, places):.{max(places, 0)}f}"
    return _signed(text.removeprefix("-") if float(text) == 0 else text)


def percent(share: float | None) -> str:
    return DASH if share is None else amount(100 * share, "%", 2)


def change(value: float, before: float) -> str:
    """How far `value` lies from `before`: per cent, or a factor where it is more than doubled or less than halved."""
    if not before or not math.isfinite(value / before):
        return DASH
    ratio = value / before
    if not 0.5 <= ratio <= 2:
        return f"× {number(ratio, 2)}" if ratio > 0 else "other sign"
    text = fixed(100 * (ratio - 1), 1)
    return f"{text if text[0] in f'{_MINUS}0' else f'+{text}'} %"


def amount(value: float | None, unit: str, digits: int = 3) -> str:
    """A value with its unit as given; a tiny share as less than the least that is printed."""
    if value is None or not math.isfinite(value):
        return number(value)
    if unit == "%" and 0 < abs(value) < LEAST_PERCENT:
        return f"< {LEAST_PERCENT:g} %"
    return f"{number(value, digits)} {unit_words(unit)}".rstrip()


def quantity(value: float | None, unit: str, digits: int = 3) -> str:
    """A value with its unit, prefixed."""
    if value is None or not math.isfinite(value):
        return number(value)
    factor, prefixed = scale([value], unit)
    return amount(factor * value, prefixed, digits)


def scale(values: Iterable[float | None], unit: str) -> tuple[float, str]:
    """Factor and prefixed unit that bring the largest of `values` between 1 and 1000."""
    largest = max((abs(v) for v in values if v is not None and math.isfinite(v)), default=0.0)
    if unit not in _PREFIXED or largest == 0:
        return 1.0, unit
    for size, prefix in _PREFIXES:
        if not (prefix in ("G", "M", "k") and unit in _NEVER_LARGE) and largest >= 0.9995 * size:
            return 1 / size, prefix + unit
    return 1e9, f"n{unit}"


def unit_words(unit: str) -> str:
    """A unit as it is printed: nothing for 1, powers raised, products with a point; a unit in words stays."""
    shown = _POWER.sub(lambda found: found[1].translate(_RAISED), _WRITTEN.get(unit, unit))
    return shown if _IN_WORDS.intersection(shown.replace("(", " ").split()) else shown.replace(" ", "·")


@dataclass(frozen=True)
class Interval:
    """A value and the ends of its interval as text, all with the same decimal places."""

    value: str
    low: str
    high: str


def with_interval(value: float, interval: tuple[float, float]) -> Interval:
    """`value` and `interval` with places that give half the interval two digits; four digits without an interval."""
    low, high = interval
    half = abs(high - low) / 2
    if not all(map(math.isfinite, (value, low, high))) or half == 0:
        return Interval(number(value), number(low), number(high))
    largest = max(abs(value), abs(low), abs(high))
    places = 1 - _exponent(half, 2)
    if places > 9 or not PLAIN[0] <= largest < PLAIN[1]:
        digits = min(max(2 + _exponent(largest, 2) - _exponent(half, 2), 2), 9)
        return Interval(number(value, digits), number(low, digits), number(high, digits))
    return Interval(*(fixed(v, places) for v in (value, low, high)))


def _exponent(value: float, digits: int) -> int:
    return int(f"{value:.{digits - 1}e}".split("e")[1])


def _signed(text: str) -> str:
    return text.replace("-", _MINUS) if text.startswith("-") else text


def measured_unit(unit: str, measured: str) -> str:
    """The unit of a number that counts in that of the measured column."""
    return unit.replace("of the measured unit", measured)
