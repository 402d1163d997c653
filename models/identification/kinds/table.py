"""Tables in which rows under the same conditions are repeats."""

from abc import abstractmethod
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from models.identification.kind import Array, Kind, Split
from models.records.record import Record

Index = NDArray[np.intp]


class TableKind(Kind):
    """One residual a condition: the mean of its repeats against the model."""

    @abstractmethod
    def keys(self, record: Record) -> Array:
        """The condition of each row, (n, m)."""

    @abstractmethod
    def scatter(self, record: Record) -> Array:
        """Standard deviation of a single reading, one a row, in the measured unit."""

    def conditions(self, record: Record) -> tuple[Array, Index]:
        """The different conditions of a record, (k, m), and the number of each row's, (n,)."""
        return distinct(self.keys(record))

    def means(self, record: Record, values: Array) -> Array:
        """Means of `values` (n,) over the rows of each condition, (k,)."""
        return means(self.conditions(record)[1], values)

    def variances(self, record: Record) -> Array:
        """Variances of the means, one a condition, by the scatter of the readings."""
        return self.means(record, self.scatter(record) ** 2) / np.bincount(self.conditions(record)[1])

    def errors(self, record: Record, predicted: Array) -> Array:
        """Measured minus predicted, one a condition."""
        return self.means(record, record[self.quantity] - predicted)

    def error(self, records: Sequence[Record], predictions: Sequence[Array]) -> float:
        """Rms over conditions, pooled over the records."""
        off = [self.errors(r, p) for r, p in zip(records, predictions, strict=True)]
        return float(np.sqrt(np.mean(np.concatenate(off) ** 2)))

    def noise_floor(self, records: Sequence[Record]) -> float:
        """The error that the scatter of the readings makes."""
        return float(np.sqrt(np.mean(np.concatenate([self.variances(r) for r in records]))))


def distinct(rows: Array) -> tuple[Array, Index]:
    """The different conditions among `rows` (n, m), shape (k, m), and the number of each row's, (n,)."""
    return _distinct(np.ascontiguousarray(rows, dtype=float).tobytes(), rows.shape[1])


@lru_cache(maxsize=64)
def _distinct(rows: bytes, width: int) -> tuple[Array, Index]:
    different, index = np.unique(np.frombuffer(rows).reshape(-1, width), axis=0, return_inverse=True)
    index = index.ravel()
    different.flags.writeable = index.flags.writeable = False
    return different, index


def means(index: Index, values: Array) -> Array:
    return np.asarray(np.bincount(index, values) / np.bincount(index), dtype=float)


def left_out_in_turn(records: Sequence[Record], index: Index, part: Index) -> list[Split]:
    """Splits by `part` of each condition, -1 for none; `index` is the condition of each row of all records."""
    belongs = np.split(part[index], np.cumsum([len(r) for r in records])[:-1])
    pairs = list(zip(records, belongs, strict=True))
    return [
        (
            [r.rows(b != fold) for r, b in pairs if np.any(b != fold)],
            [r.rows(b == fold) for r, b in pairs if np.any(b == fold)],
        )
        for fold in range(int(part.max()) + 1)
    ]
