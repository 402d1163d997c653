"""What the tables of drives have in common that count in turns and coast without torque."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from models.files.tables import check_ranges
from models.parameter import nearest

HOMES: Final = ("kept", "here")
"""What becomes of the drive's zero: it stays, or is made the present place."""


class Turning:
    """Checks and the time to rest of a table with `watchdog_s`, `coast_m_s2` and `home`."""

    watchdog_s: float
    coast_m_s2: float
    home: str

    def check(self, table: str, ranges: Sequence[tuple[str, float, float]]) -> None:
        """Raises ValueError of one sentence where a key of `[table]` is out of its range, the sign of `turns_per_m` set
        aside, or `home` is none of `HOMES`.
        """
        check_ranges(self, table, ranges, either_sign=("turns_per_m",))
        if self.home not in HOMES:
            choices = f"one of {', '.join(HOMES)}"
            raise ValueError(f"{table}.home must be {choices}; got {self.home!r}; {nearest(self.home, HOMES)}")

    def stops_s(self, speed_m_s: float) -> float:
        """The longest time in s from the last command to the carriage at rest, from `speed_m_s`."""
        return self.watchdog_s + abs(speed_m_s) / self.coast_m_s2
