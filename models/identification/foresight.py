"""What a search will take and what it can show, known before it begins."""

import time
from collections.abc import Sequence
from typing import Final

import numpy as np

from models.identification.kinds.reports import AnyKind
from models.identification.search.screening import null_distribution, records_for_null
from models.records.record import Record
from models.words.quantities import measured_unit
from models.words.sentences import Quantity
from models.workers import worker_count

_POINTS: Final = 8  # that a kind simulates at once
_BATCHES: Final = 1500.0  # of points, in the search of an effect
_TRIES: Final = 3  # of a timing: the shortest counts


def seconds_of_search(kind: AnyKind, records: Sequence[Record]) -> float:
    """About how long the search for one effect takes in `records`, on the workers that there are: from the time of one
    simulation, and from the rows that all splits fit.
    """
    searched, values, spent = kind.searched(records), [kind.nominal()] * _POINTS, list[float]()
    for _ in range(_TRIES):
        began = time.perf_counter()
        for record in searched:
            kind.predictions(record, values)
        spent.append(time.perf_counter() - began)
    fitted = sum(len(record) for part, _ in kind.splits(searched) for record in part)
    return _BATCHES * min(spent) * max(fitted / sum(map(len, searched)), 1.0) / worker_count()


def smallest(kind: AnyKind, records: Sequence[Record]) -> dict[str, Quantity]:
    """The smallest amplitude of each effect of `kind` that a search in such `records` would tell from chance, before
    any fit: in records that the nominal model makes. Nothing where they are too few for that.
    """
    part = records_for_null(kind, kind.searched(records))
    _, sizes, _ = null_distribution(kind, part, kind.nominal(), np.random.default_rng(0))
    units = {name: kind.declared(name).amplitude().unit for name in sizes}
    return {name: Quantity(size, measured_unit(units[name], kind.unit)) for name, size in sorted(sizes.items())}
