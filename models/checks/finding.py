"""What a check found in a record."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Literal

Severity = Literal["stops", "weakens", "note"]


@dataclass(frozen=True)
class RecordFinding:
    """One thing about one record that a reader should know before any fit.

    `severity`: "stops" (nothing may be fitted), "weakens" (a verdict `none` or `named` needs more than these records)
    or "note". `where` names columns, rows or times; `how` says how it was found; `remedy` is a line for the rig file, a
    command, or what to record. `direction` is the sign of what has one, for the checks of a whole series.
    """

    id: str
    severity: Severity
    file: str
    where: str
    sentence: str
    how: str
    remedy: str
    direction: int = 0

    def to_dict(self) -> dict[str, str]:
        """As JSON has it."""
        return {name: value for name, value in asdict(self).items() if name != "direction"}


Findings = Iterator[RecordFinding]
