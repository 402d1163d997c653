"""Units as people and instruments write them, and the factors between them.

`units.toml` is a table of our own: pint takes `g` for a mass and an angle for a plain number, and reads no words in
any case, brackets or endings of column names.
"""

import difflib
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Final


@dataclass(frozen=True)
class Unit:
    """A unit: what it measures, and its factor to SI (to turns, for angles)."""

    dimension: str
    factor: float


_TABLES: Final = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
_RATES: Final = {"rev/s": "Hz", "/s": "Hz"}  # quotients that have a name


def _table() -> Mapping[str, Unit]:
    prefixes, of_words = _TABLES["prefixes"]["symbols"], _TABLES["prefixes"]["words"]
    symbols = {
        prefix + symbol: Unit(dimension, size * factor)
        for table, sizes in (("prefixed", prefixes), ("plain", {"": 1.0}))
        for dimension, factor, spellings in _TABLES[table].values()
        for symbol in spellings
        for prefix, size in sizes.items()
    }
    words = {
        prefix + word + plural: symbols[letter + symbol]
        for word, symbol in _TABLES["words"].items()
        for prefix, letter in of_words.items()
        for plural in ("", "s")
        if letter + symbol in symbols
    }
    return MappingProxyType({**words, "inches": symbols["in"], **symbols})


UNITS: Final = _table()
"""Every unit but quotients by each of its spellings; `g` is gram-force."""


@cache
def unit(text: str) -> Unit | None:
    """The unit that is written as `mm`, `mm/s`, `mm_per_s` or `milliseconds`, say; None for an unknown one."""
    plain = text.strip().strip("[](){}<>").strip().replace("\u00b5", "u").replace("\u03bc", "u")
    found = UNITS.get(plain) or UNITS.get(plain.lower() if len(plain) > 3 else plain)
    if found or not plain:
        return found
    over = re.fullmatch(r"(.+?)(?:\s*/\s*|_per_|\s+per\s+|_)([^/_]+)", plain)
    parts = over or re.fullmatch(r"(.*?)[\s*.\u00b7]*([A-Za-z]+)\^?-1", plain)
    upper, lower = (unit(parts[1] or "1"), unit(parts[2])) if parts else (None, None)
    if upper is None or lower is None:
        return None
    dimension = f"{upper.dimension}/{lower.dimension}"
    return Unit(_RATES.get(dimension, dimension), upper.factor / lower.factor)


def factor(text: str, target: str) -> float | None:
    """Factor from the unit `text` to `target` ("": a plain number); None where one is unknown or another measure."""
    found, wanted = unit(text), unit(target or "1")
    if found is None or wanted is None or found.dimension != wanted.dimension:
        return None
    return found.factor / wanted.factor


def fitting(target: str) -> list[str]:
    """The short spellings of units that convert to `target`."""
    wanted = unit(target or "1")
    usual = [*UNITS, "mm/s", "m/s", "um/s", "cm/s", "mm/min", "deg/s", "rad/s"]
    return [text for text in usual if wanted and (found := unit(text)) and found.dimension == wanted.dimension]


def nearest_unit(text: str, target: str) -> str:
    """A hint at the unit nearest to `text` that converts to `target`."""
    known = fitting(target)
    close = difflib.get_close_matches(text, known, n=1, cutoff=0.4)
    return f"did you mean {close[0]!r}?" if close else f"such as {target or '1'!r}"


_BRACKETS: Final = re.compile(r"(.*?)\s*[\[({<]([^\[\](){}<>]*)[\])}>]\s*")
_ENDING: Final = re.compile(r"(?:\s*[/,:]\s*|\s+in\s+|[\s_.]+)")


def split_unit(name: str) -> tuple[str, str]:
    """A column's name and unit, "" for none: `Position [mm]`, `F / mN`, `pos_mm`; in brackets also an unknown one."""
    bracketed = _BRACKETS.fullmatch(name)
    if bracketed and bracketed[1].strip() and not bracketed[2].isdigit():
        return bracketed[1].strip(), bracketed[2].strip()
    for gap in _ENDING.finditer(name):
        stem, rest = name[: gap.start()], name[gap.end() :]
        if stem and unit(rest) and not (rest.isdigit() and gap[0].isspace()):  # a number, as in "Kanal 1", is no unit
            return stem.strip(), rest.strip()
    return name.strip(), ""


def unit_of(column: str) -> str:
    """The unit that a column of ours ends in; "" for a plain number."""
    return split_unit(column)[1]


_SIGNS: Final = "mm|ms|m|kg|s|N|deg|rad|A|T|V|H|C|Pa|Hz|Ohm|m2|m3|s2|percent"
_UNIT_AT_END: Final = re.compile(rf"(.*?)_((?:(?:{_SIGNS})(?:_(?:{_SIGNS}))*)?)(?:_?per_({_SIGNS}))?")
_WRITTEN: Final = {"C": "degC", "percent": "%"}


def unit_at_end(name: str) -> tuple[str, str]:
    """A name of ours and the unit it ends in as printed, "" for none: `speed_m_s` (m/s), `stiffness_N_per_m` (N/m)."""
    found = _UNIT_AT_END.fullmatch(name)
    if found is None or not (found[2] or found[3]):
        return name, ""
    upper, lower = [_WRITTEN.get(sign, sign) for sign in found[2].split("_") if sign] or ["1"], found[3]
    if lower is None and len(upper) > 1 and upper[-1] in ("s", "s2"):
        lower = upper.pop()
    return found[1], " ".join(upper) + (f"/{lower}" if lower else "")
