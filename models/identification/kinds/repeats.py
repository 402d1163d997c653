"""Tables in which rows under the same conditions repeat each other."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from models.identification.kind import Array
from models.records.record import Record

Index = NDArray[np.intp]
Split = tuple[list[Record], list[Record]]


def distinct(rows: Array) -> tuple[Array, Index]:
    """The different conditions among `rows` (n, m), shape (k, m), and for each row which one it is, (n,)."""
    return _distinct(np.ascontiguousarray(rows, dtype=float).tobytes(), rows.shape[1])


@lru_cache(maxsize=64)
def _distinct(rows: bytes, width: int) -> tuple[Array, Index]:
    different, index = np.unique(np.frombuffer(rows).reshape(-1, width), axis=0, return_inverse=True)
    index = index.ravel()
    different.flags.writeable = index.flags.writeable = False
    return different, index


def means(index: Index, values: Array) -> Array:
    """Means of `values` (n,) over the rows of each condition, (k,)."""
    return np.asarray(np.bincount(index, values) / np.bincount(index), dtype=float)


def pooled_rms(parts: Sequence[Array]) -> float:
    """Root of the mean square of all `parts` together."""
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def left_out_in_turn(records: Sequence[Record], index: Index, part: Index) -> list[Split]:
    """Splits that leave out the conditions of each part in turn: `index` says of every row of all records which
    condition it is, `part` of every condition to which part it belongs, -1 to none.
    """
    belongs = np.split(part[index], np.cumsum([len(r) for r in records])[:-1])
    pairs = list(zip(records, belongs, strict=True))
    return [
        (
            [r.rows(b != fold) for r, b in pairs if np.any(b != fold)],
            [r.rows(b == fold) for r, b in pairs if np.any(b == fold)],
        )
        for fold in range(int(part.max()) + 1)
    ]
