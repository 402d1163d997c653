"""Whether a record may be left out of training to judge by: not where its speed, direction or place is in no other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.checks.view import View
from models.records.record import Record
from models.rigs.rig import Rig

_NEAR = 1.25  # a speed this close to another one counts as the same
_OVERLAP = 0.4  # of a record's places that the others must cover
_A_WAY = 0.1  # share of the motion from which a direction counts
_ONE_SPEED = 1.3


@dataclass(frozen=True)
class Conditions:
    """Slow and fast speed in m/s while in motion, the directions, and the span of places in m of one record."""

    slow: float
    fast: float
    directions: frozenset[float]
    low: float
    high: float

    @classmethod
    def of(cls, record: Record) -> Conditions:
        """The conditions of a time series."""
        view = View(record, Rig(record.kind))
        v = view.speed[view.moves]
        x = record[view.moving_column]
        slow, fast = (float(q) for q in np.percentile(np.abs(v), [10, 90])) if len(v) else (0.0, 0.0)
        ways = frozenset(d for d in (-1.0, 1.0) if len(v) and np.mean(np.sign(v) == d) > _A_WAY)
        return cls(slow, fast, ways, float(x.min()), float(x.max()))


def may_be_left_out(record: Record, others: Sequence[Record]) -> bool:
    """Whether `others` hold about the speeds, the directions and the places of `record`."""
    own, rest = Conditions.of(record), [Conditions.of(other) for other in others]
    ways = frozenset[float]().union(*(r.directions for r in rest))
    low, high = min(r.low for r in rest), max(r.high for r in rest)
    shared = min(own.high, high) - max(own.low, low)
    places = own.high == own.low or shared >= _OVERLAP * (own.high - own.low)
    return own.directions <= ways and places and _speeds_held(own, rest)


def _speeds_held(own: Conditions, rest: Sequence[Conditions]) -> bool:
    """A record of one speed needs another with that speed; one of several needs others that go as slow and as fast."""
    if own.fast <= _ONE_SPEED * own.slow:
        return any(r.slow / _NEAR <= own.fast and own.slow <= r.fast * _NEAR for r in rest)
    return min(r.slow for r in rest) <= _NEAR**2 * own.slow and own.fast <= _NEAR**2 * max(r.fast for r in rest)
