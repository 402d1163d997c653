"""How long a search will take, from the time of one simulation."""

import time
from collections.abc import Sequence
from typing import Final

from models.identification.kinds.reports import AnyKind
from models.records.record import Record
from models.workers import worker_count

_POINTS: Final = 8  # that a kind simulates at once
_BATCHES: Final = 1500.0  # of points, in the search of an effect
_TRIES: Final = 3  # of a timing: the shortest counts


def seconds_of_search(kind: AnyKind, records: Sequence[Record]) -> float:
    """About how long the search for one effect takes in `records`, on the workers that there are."""
    values = [kind.nominal()] * _POINTS
    spent = []
    for _ in range(_TRIES):
        began = time.perf_counter()
        for record in kind.searched(records):
            kind.predictions(record, values)
        spent.append(time.perf_counter() - began)
    return _BATCHES * min(spent) / worker_count()
