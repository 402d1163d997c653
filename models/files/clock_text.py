"""Stamps that a logger wrote as a time of day or as a date with one, in seconds."""

import math
import re
from datetime import UTC, datetime
from typing import Final

import numpy as np
from numpy.typing import NDArray

DAY_S: Final = 86400.0  # a stamp from here on is no time of day
_OF_DAY = re.compile(r"(?:.*[ T])?(\d{1,2}):(\d{2}):(\d{2}(?:\.\d*)?)(?: ?([AaPp])[Mm])?")
_MINUTES = re.compile(r"(\d{1,4}):(\d{2}\.\d*)")


def clock_s(cell: str) -> float:
    """A cell in s; NaN where it is neither a number nor a stamp.

    ISO 8601 (`2026-03-01T12:30:00.125Z`, a space for the T) counts from 1970, UTC where it has no zone; a time of day
    (`12:30:00.125`, `1:30:00 PM`, after a date in another order or without one) from midnight; `90:12.5` is minutes and
    seconds.
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
    """Times of day (n,) that go on over the next midnight, after one that came `before` (NaN: none did); dated ones as
    they are.
    """
    if (times >= DAY_S).any():
        return times
    start = times[0] if math.isnan(before) else before
    steps = np.diff(times, prepend=start % DAY_S)
    return np.asarray(times + DAY_S * (start // DAY_S + np.cumsum(steps < -0.5 * DAY_S)))


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
