"""What `capsule jog --script` and the table `[jog]` of a scenario read: one setpoint a line, and for how long."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from models.parameter import nearest

_NUMBERS: Final = {"speed": ("MM_S", "SECONDS"), "position": ("MM", "SECONDS"), "release": ("SECONDS",)}
_LONGEST_S: Final = 86400.0  # a day


@dataclass(frozen=True, slots=True)
class Step:
    """One line: `mode` speed, position or release, its value in m/s or m, and how long it is sent."""

    mode: str
    value: float
    seconds: float


def steps(lines: Iterable[str], name: str) -> Iterator[Step]:
    """The steps of a script, empty lines and comments from `#` on left out. Raises ValueError naming the line."""
    for number, line in enumerate(lines, 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        where = f"{name} line {number}"
        if words[0] not in _NUMBERS:
            raise ValueError(
                f"{where}: step must be one of {', '.join(_NUMBERS)}; got {words[0][:40]!r};"
                f" {nearest(words[0], list(_NUMBERS))}"
            )
        wanted = _NUMBERS[words[0]]
        values = [_number(word) for word in words[1:]]
        if len(values) != len(wanted) or not all(map(math.isfinite, values)):
            raise ValueError(f"{where}: step must be '{words[0]} {' '.join(wanted)}'; got {line.strip()[:60]!r}")
        if not 0 < values[-1] <= _LONGEST_S:
            raise ValueError(f"{where}: seconds must lie above 0 and at most {_LONGEST_S:g}; got {values[-1]:g}")
        yield Step(words[0], 1e-3 * values[0] if len(values) == 2 else 0.0, values[-1])


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return math.nan
