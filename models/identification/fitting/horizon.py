"""Where fits from anywhere begin: points around starts, and prefixes of records that grow."""

from collections.abc import Iterator, Sequence

import numpy as np
import scipy

from models.checks.usable import lead_in_s
from models.identification.fitting.fit import FreeParameter
from models.identification.kind import Kind
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


def lengths(kind: Kind, records: Sequence[Record]) -> Iterator[tuple[int, list[Record]]]:
    """Number of a length and records cut to it, the whole ones last."""
    for number, length in enumerate((*kind.beginnings_s, np.inf)):
        parts = prefixes(records, length)
        if length == np.inf or any(len(part) < len(record) for part, record in zip(parts, records, strict=True)):
            yield number, parts


def prefixes(records: Sequence[Record], length: float) -> list[Record]:
    """The first `length` s of each record that count, and the rows before."""
    return [record.beginning(length + lead_in_s(record)) for record in records]


def scattered(
    kind: Kind, moved: Sequence[FreeParameter], starts: Sequence[Theta], count: int, seed: int, fresh: str = ""
) -> list[Theta]:
    """So many points around the nominal base and the effects of `starts`; with every size of the effect `fresh`."""
    return [
        start | {axis.name: _place(kind, axis, start, share, fresh) for axis, share in zip(moved, row, strict=True)}
        for start, row in zip(_again(starts, count), _shares(len(moved), count, seed), strict=False)
    ]


def _again(starts: Sequence[Theta], count: int) -> list[Theta]:
    return [starts[i % len(starts)] for i in range(count)]


def _shares(dimensions: int, count: int, seed: int) -> np.ndarray:
    """Points (count, dimensions) between 0 and 1; none where nothing moves."""
    return scipy.stats.qmc.Sobol(dimensions, seed=seed).random(count) if dimensions else np.zeros((0, 0))


def _place(kind: Kind, axis: FreeParameter, start: Theta, share: float, fresh: str) -> float:
    """The value of one parameter for a number `share` between 0 and 1."""
    p = axis.parameter
    if not p.effect:
        value = p.value + min(SET.base_off * abs(p.value), SET.near_start * p.spread) * (2 * share - 1)
    elif p.effect == fresh and p.name == kind.catalogue[fresh].amplitude().name:
        sign, size = np.sign(share - 0.5) or 1.0, abs(2 * share - 1)
        value = sign * kind.catalogue[fresh].probe * 2 ** (SET.doublings * size)
        value = value if p.lower <= value <= p.upper else -value
    else:
        value = start.get(axis.name, p.value)
        reach = min(p.spread, max(SET.near_start * axis.scale, SET.near_start / 10 * abs(value)))
        value += reach * (2 * share - 1)
    return float(np.clip(value, p.lower, p.upper))
