"""The text of a CSV file: header and units below lines about the file, and cells as numbers or stamps in seconds."""

import csv
import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Final

import numpy as np
from numpy.typing import NDArray

from models.files.units import unit

LONGEST_TOP: Final = 100  # non-blank lines within which the header must stand
SPACES: Final = " "  # separator of cells with any number of spaces between them
_COMMENTS: Final = ("#", "%", "//")
# how a cell begins that a spreadsheet takes for a formula, or one that was guarded
_FORMULA: Final = "('* *[=+\\-@\uff1d\uff0b\uff0d\uff20])"
_OPEN, _GUARDED = (re.compile(f'(^|[;,\t\r\n"]){guard}{_FORMULA}') for guard in ("", "'"))
# marks between groups of three digits, and what is no such number
_GROUPS: Final = re.compile(r"(?<![\d.,])[1-9]\d{0,2}[.,'\u2019\u00a0\u202f]\d{3}(?!\d)")
_TWICE: Final = re.compile(r"\d[.,'\u2019\u00a0\u202f]\d{3}[.,]\d|\d['\u2019\u00a0\u202f]\d{3}(?!\d)")
_ONE_GROUP: Final = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")
_GROUPED: Final = re.compile(r"[+-]?[1-9]\d{0,2}(?:\.\d{3})+|[+-]?[1-9]\d{0,2}(?:,\d{3})+")
_BOTH: Final = re.compile(r"[+-]?[1-9]\d{0,2}(?:(?:,\d{3})+\.\d+|(?:\.\d{3})+,\d+)")
_WHOLE: Final = re.compile(r"[+-]?\d{1,3}")
_SPACED: Final = re.compile(r"(?<=\d)['\u2019\u00a0\u202f](?=\d{3}(?!\d))")
_QUOTED: Final = re.compile('"[^"]*"')


@dataclass(frozen=True)
class Header:
    """The header's `line` and `separator`; `rows` is the number of the lines above the first row of values, `units`
    what a row of units has for each column, else empty.
    """

    line: str
    separator: str
    rows: int
    units: tuple[str, ...] = ()


def guarded(name: str) -> str:
    """A name with an apostrophe wherever a spreadsheet, by any separator of cells, would see a formula begin."""
    return _OPEN.sub(r"\1'\2", name)


def unguarded(cell: str) -> str:
    """The name of which `guarded` made `cell`."""
    return _GUARDED.sub(r"\1\2", cell)


def find_header(top: Sequence[str], names: Collection[str] = ()) -> Header | None:
    """The header among the first non-blank lines of a file: a line that has one of `names`, else the last one with as
    many cells as the first row of numbers, else the first line that is no comment; None without any.
    """
    lines = [re.sub(r"^(#|%|//)", "", line.lstrip()) for line in top]
    plain = next((k for k, line in enumerate(top) if not line.lstrip().startswith(_COMMENTS)), None)
    if plain is None:
        return None
    named = next((k for k in range(len(lines)) if _has(lines, k, names)), None)
    at = _above_numbers(lines, plain) if named is None else named
    separator = separator_of(lines[at])
    units = _units(lines[at + 1], separator, len(cells(lines[at], separator))) if at + 1 < len(lines) else ()
    return Header(lines[at], separator, at + 1 + bool(units), units)


def separator_of(line: str) -> str:
    line = _QUOTED.sub("x", line)
    if ";" in line:
        return ";"
    if "\t" in line and "," not in line:
        return "\t"
    return "," if "," in line or len(line.split()) < 2 else SPACES


def split(line: str, separator: str) -> list[str]:
    """The cells of a line. Raises csv.Error."""
    if separator == SPACES:
        line = line.strip()
    return next(csv.reader([line], delimiter=separator, skipinitialspace=separator == SPACES), [])


def bare(cell: str) -> str:
    return unguarded(cell.strip().strip('"').strip())


def cells(line: str, separator: str) -> list[str]:
    """The cells of a line without spaces and quotes; none of a line that cannot be split."""
    try:
        return list(map(bare, split(line, separator)))
    except csv.Error:
        return []


def to_number(cell: str) -> float:
    """A cell as a number, else NaN, as for Python's `1_000`."""
    try:
        return math.nan if "_" in cell else float(cell)
    except ValueError:
        return math.nan


def may_group(lines: Sequence[str], separator: str) -> bool:
    """Whether digits in the lines may stand in groups of three: not where all have as many marks and none has two."""
    if separator == ",":
        return any('"' in line and _GROUPS.search(line) for line in lines)
    marks = {line.count(".") + line.count(",") for line in lines}
    return any(_TWICE.search(line) or (len(marks) > 1 and _GROUPS.search(line)) for line in lines)


def ungrouped(column: Sequence[str], separator: str) -> Sequence[str]:
    """The cells of a column with a decimal point and without marks between groups of digits: 1,234.5 or 1.234,5 or
    1'234. A single mark, as in 1.234, groups where others of the column are whole numbers below 1000 without one.
    """
    cells = [cell.strip().strip('"') for cell in column]
    marked = [cell for cell in cells if "." in cell or "," in cell]
    single = [cell for cell in marked if _ONE_GROUP.fullmatch(cell)]
    short = any(_WHOLE.fullmatch(cell) and cell.strip("+-0") for cell in cells)
    groups = (
        short and len(single) == len(marked) and len({mark for cell in single for mark in ".," if mark in cell}) == 1
    )
    decimal = "." if separator == "," else ",."
    return [_plain(cell, groups, decimal) for cell in cells]


def _plain(cell: str, groups: bool, decimal: str) -> str:
    marks = [mark for mark in cell if mark in ".,"]
    bare = _SPACED.sub("", cell)
    if len(set(marks)) == 2 and _BOTH.fullmatch(bare):
        return bare.replace(marks[0], "").replace(marks[-1], ".")
    if (groups or len(marks) > 1) and _GROUPED.fullmatch(bare):
        return bare.replace(".", "").replace(",", "")
    return bare.replace(",", ".") if "," in decimal else bare


def _has(lines: Sequence[str], row: int, names: Collection[str]) -> bool:
    """Whether a line has one of `names`; words between spaces are a header only right above numbers."""
    separator = separator_of(lines[row])
    found = cells(lines[row], separator)
    return bool(set(found) & set(names)) and (
        separator != SPACES or any(_columns(line, separator) == len(found) for line in lines[row + 1 : row + 3])
    )


def _columns(line: str, separator: str) -> int:
    """Count of numbers in a line; 0 where it has anything else, or only one."""
    found = cells(line, separator)
    return len(found) if len(found) > 1 and all(_is_number(cell, separator) for cell in found) else 0


def _above_numbers(lines: Sequence[str], otherwise: int) -> int:
    """The last line, but for a row of units, with as many cells as the first row of numbers below it."""
    for row, line in enumerate(lines):
        for separator in (";", "\t", ",", SPACES):
            if columns := _columns(line, separator):
                return next((k for k in range(row - 1, -1, -1) if _is_header(lines, k, separator, columns)), otherwise)
    return otherwise


def _is_header(lines: Sequence[str], row: int, separator: str, columns: int) -> bool:
    """Whether a line names each column and is no row of units below one that does."""
    names = cells(lines[row], separator)
    if len(names) != columns or separator_of(lines[row]) != separator:
        return False
    if any(name and _is_number(name, separator) for name in names):
        return False
    above = cells(lines[row - 1], separator) if row else []
    return len(above) != columns or not _units(lines[row], separator, columns)


def _is_number(cell: str, separator: str) -> bool:
    return not math.isnan(clock_s(cell if separator == "," else cell.replace(",", "."))) or not cell


def _units(line: str, separator: str, columns: int) -> tuple[str, ...]:
    """The cells of a row of units without brackets; none where at most half of them are known units."""
    found = [cell.strip("[](){}<>").strip() for cell in cells(line, separator)]
    stated = [cell for cell in found if cell not in ("", "-")]
    if len(found) != columns or not stated or any(not math.isnan(to_number(cell)) for cell in stated):
        return ()
    return tuple(found) if sum(unit(cell) is not None for cell in stated) * 2 >= len(stated) else ()


DAY_S: Final = 86400.0  # a stamp from here on is no time of day
_OF_DAY = re.compile(r"(?:.*[ T])?(\d{1,2}):(\d{2}):(\d{2}(?:\.\d*)?)(?: ?([AaPp])[Mm])?")
_MINUTES = re.compile(r"(\d{1,4}):(\d{2}\.\d*)")


def clock_s(cell: str) -> float:
    """A cell in s; NaN where it is neither a number nor a stamp.

    ISO 8601 (`2026-03-01T12:30:00.125Z`, or a space for the T) counts from 1970, in UTC where it has no zone. A time of
    day (`12:30:00.125`, `1:30:00 PM`, also after another date) counts from midnight; `90:12.5` is minutes and seconds.
    """
    text = cell.strip().strip('"').strip()
    try:
        return float(text)
    except ValueError:
        pass
    if text[:5].count("-") == 1 or text[8:9] == "T":
        return _dated(text)
    if minutes := _MINUTES.fullmatch(text):
        return 60.0 * int(minutes[1]) + float(minutes[2])
    return _of_day(text)


def over_midnight(times: NDArray[np.float64], before: float) -> NDArray[np.float64]:
    """Times of day (n,) that go on past midnight, after the one `before` (NaN: none); dated ones unchanged."""
    there = times[np.isfinite(times)]
    if (there >= DAY_S).any() or not there.size:
        return times
    start = there[0] if math.isnan(before) else before
    days = start // DAY_S + np.cumsum(np.diff(there, prepend=start % DAY_S) < -0.5 * DAY_S)
    later = times.copy()
    later[np.isfinite(times)] += DAY_S * days
    return later


def _of_day(text: str) -> float:
    found = _OF_DAY.fullmatch(text)
    if found is None:
        return math.nan
    hour, minute, second = int(found[1]), int(found[2]), float(found[3])
    if found[4]:
        hour = hour % 12 + 12 * (found[4] in "pP")
    if hour > 23 or minute > 59 or second >= 61:
        return math.nan
    return 3600.0 * hour + 60.0 * minute + second


def _dated(text: str) -> float:
    try:
        at = datetime.fromisoformat(text)
    except ValueError:
        return math.nan
    return (at if at.tzinfo else at.replace(tzinfo=UTC)).timestamp()
