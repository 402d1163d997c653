"""A measured record: columns of one CSV, checked against what its kind of rig needs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Record:
    """One record in memory; `columns` maps a column's name to its samples, all of one length."""

    name: str
    kind: str
    columns: dict[str, NDArray[np.float64]]

    def __getitem__(self, column: str) -> NDArray[np.float64]:
        return self.columns[column]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def with_column(self, column: str, values: Any) -> Record:
        """The same record with one column replaced or added."""
        return Record(self.name, self.kind, {**self.columns, column: np.asarray(values, dtype=float)})

    def rows(self, index: Any) -> Record:
        """The same record with only the rows of `index`."""
        return Record(self.name, self.kind, {key: column[index] for key, column in self.columns.items()})
