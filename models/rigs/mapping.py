"""`[columns]` of a rig file: names, units, signs and offsets that map a file's columns to ours."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.files.units import factor, nearest_unit, split_unit, unit, unit_of
from models.parameter import nearest
from models.rigs.columns import LOADS, TIME


@dataclass(frozen=True)
class MappedColumn:
    """`target = sign * scale * (column - offset)` in the unit `unit`, then converted to ours. The offset is in the
    file's numbers, and so is `wrap`, after which an angle or a counter begins again: larger jumps than half of it are
    undone. A `rate_Hz` in place of a column gives the times of samples that have none.

    With a `scale`, what the file states of its unit (volts, counts, pixels) is ignored, and a `unit` left out is ours.
    Else the unit is the one that the file states or the column's name ends in, else ours. Raises ValueError for a unit
    that does not convert to that of `target`.
    """

    target: str
    column: str
    unit: str | None = None
    sign: int = 1
    offset: float = 0.0
    scale: float | None = None
    wrap: float | None = None
    rate_Hz: float | None = None

    def __post_init__(self) -> None:
        if self.unit is not None:
            _factor(self.unit, self.target)
        if bool(self.column) == bool(self.rate_Hz) or (self.rate_Hz and self.target != TIME):
            raise ValueError(f"{self.target} must have a 'column', or for t_s a 'rate_Hz'; got {self.table()}")

    def values(self, raw: Any, stated: str = "") -> NDArray[np.float64]:
        """Values of the file (n,), whose own unit is `stated`, as ours, NaN where there are none."""
        if self.rate_Hz:
            return np.arange(len(raw)) / self.rate_Hz
        values = self.sign * (np.asarray(raw, dtype=float) - self.offset) * self.factor(stated)
        known = np.isfinite(values)
        if self.wrap is not None and known.any():
            values[known] = np.unwrap(values[known], period=self.wrap * abs(self.factor(stated)))
        return values

    def factor(self, stated: str = "") -> float:
        """The factor on a difference in the file, without the sign. Raises ValueError as the class does."""
        if self.scale is not None:
            return self.scale * (_factor(self.unit, self.target) if self.unit else 1.0)
        own = self.unit or stated or split_unit(self.column)[1]
        as_logged = not self.unit and self.target in LOADS and not unit_of(self.target)  # in whichever unit
        return 1.0 if as_logged or not (self.unit or unit(own)) else _factor(own, self.target)

    def table(self) -> dict[str, Any]:
        """The keys of its table in a rig file that are not left at their defaults."""
        unset = {field.name: field.default for field in fields(self) if field.name != "target"}
        return {key: getattr(self, key) for key, default in unset.items() if getattr(self, key) != default}

    @property
    def plain(self) -> bool:
        """Whether it changes nothing."""
        return self == MappedColumn(self.target, self.target)


def _factor(own: str, target: str) -> float:
    found = factor(own, unit_of(target))
    if found is None:
        raise ValueError(
            f"unit of {target} must be one that converts to {unit_of(target) or 'plain numbers'}; got {own!r};"
            f" {nearest_unit(own, unit_of(target))}"
        )
    return found


@dataclass(frozen=True)
class ColumnMap:
    """`[columns]` of a rig file. A file with a column of ours by its own name, not the mapped one, is read as it is."""

    entries: tuple[MappedColumn, ...] = ()

    def entry(self, target: str) -> MappedColumn:
        """The source of our column `target`; the column of that name where nothing is stated."""
        return next((entry for entry in self.entries if entry.target == target), MappedColumn(target, target))

    def sources(
        self, where: str, header: Sequence[str], known: Sequence[str], optional: Sequence[str] = ()
    ) -> dict[str, MappedColumn]:
        """Which column of `header` each of the `known` columns of ours is read from.

        Columns of ours that are neither mapped nor in the header are left out; a mapped column that is not there is a
        ValueError of one sentence, unless ours is `optional` or stands in the header itself.
        """
        found = {name: MappedColumn(name, name) for name in known if name in header}
        for entry in self.entries:
            if entry.rate_Hz:
                found.setdefault(entry.target, entry)
            elif entry.column in header:
                found[entry.target] = entry
            elif entry.target not in found and entry.target not in optional:
                raise ValueError(
                    f"{where}: [columns] {entry.target} must name a column of the file; got {entry.column!r};"
                    f" {nearest(entry.column, [name for name in header if name])}"
                )
        return found


def contradiction(target: str, source: MappedColumn, units: Mapping[str, str]) -> str:
    """The unit that a file states for a column with our name, where it differs from ours; else empty."""
    stated = units.get(source.column, "")
    return stated if source.plain and unit(stated) and factor(stated, unit_of(target)) != 1.0 else ""
