"""Accepted numbers: parameter sets in TOML, and in `measured/` what the seed papers measured and printed."""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.parameter import nearest, one_of

MEASURED = Path(__file__).parent / "measured"


@dataclass(frozen=True)
class PaperMeasurement:
    """One printed table: columns (float arrays in the unit of `units`, or text), source, and a caution for its use."""

    name: str
    title: str
    source: str
    caution: str
    units: Mapping[str, str]
    columns: Mapping[str, NDArray[Any]]

    def __getitem__(self, column: str) -> NDArray[Any]:
        if column not in self.columns:
            raise KeyError(f"measurement {self.name} has no column {column!r}; {nearest(column, dict(self.columns))}")
        return self.columns[column]

    def select(self, **where: object) -> PaperMeasurement:
        """The rows whose columns equal the given values, as `select(sample=1)`."""
        keep = np.all([self[column] == value for column, value in where.items()], axis=0)
        columns = MappingProxyType({name: column[keep] for name, column in self.columns.items()})
        return PaperMeasurement(self.name, self.title, self.source, self.caution, self.units, columns)


def measured_path(name: str) -> Path:
    """The CSV file of a measured table; a miss names the nearest one (`ValueError`)."""
    return one_of(MEASURED, name, ".csv", "measurement")


@cache
def load_measurement(name: str) -> PaperMeasurement:
    """The table of `measured/NAME.csv` and its entry in `measured.toml`. Raises ValueError where the columns differ."""
    path = measured_path(name)
    head = tomllib.loads((MEASURED / "measured.toml").read_text(encoding="utf-8"))[name]
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    units: dict[str, str] = head["columns"]
    if list(units) != list(rows[0]):
        raise ValueError(f"columns of {path.name} must be {list(units)}; got {list(rows[0])}")
    columns = {c: np.array([row[c] if unit == "text" else float(row[c]) for row in rows]) for c, unit in units.items()}
    return PaperMeasurement(
        name, head["title"], head["source"], head["caution"], MappingProxyType(units), MappingProxyType(columns)
    )
