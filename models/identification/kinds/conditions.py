"""Whether a record may validate a fit to the others: not where its speed, direction or position is in no other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from models.checks.view import View
from models.identification.settings import SET
from models.records.record import Record
from models.rigs.rig import Rig


@dataclass(frozen=True)
class Conditions:
    """Slow and fast speed in m/s while in motion, directions, and the range of positions in m of one record."""

    slow: float
    fast: float
    directions: frozenset[float]
    low: float
    high: float

    @classmethod
    @lru_cache(maxsize=64)
    def of(cls, record: Record) -> Conditions:
        view = View(record, Rig(record.kind))
        v = view.speed[view.moves]
        x = record[view.moving_column]
        slow, fast = (float(q) for q in np.percentile(np.abs(v), [10, 90])) if len(v) else (0.0, 0.0)
        directions = frozenset(d for d in (-1.0, 1.0) if len(v) and np.mean(np.sign(v) == d) > SET.condition_way)
        return cls(slow, fast, directions, float(x.min()), float(x.max()))


def may_be_left_out(record: Record, others: Sequence[Record]) -> bool:
    """Whether `others` cover about the directions, the positions and the speeds of `record`, or its one speed."""
    own, rest = Conditions.of(record), [Conditions.of(other) for other in others]
    directions = frozenset[float]().union(*(r.directions for r in rest))
    low, high = min(r.low for r in rest), max(r.high for r in rest)
    shared = min(own.high, high) - max(own.low, low)
    if not own.directions <= directions or (
        own.low < own.high and shared < SET.condition_overlap * (own.high - own.low)
    ):
        return False
    if own.fast <= SET.one_speed * own.slow:
        return any(r.slow / SET.same <= own.fast and own.slow <= r.fast * SET.same for r in rest)
    slow, fast = min(r.slow for r in rest), max(r.fast for r in rest)
    return bool(slow <= SET.same**2 * own.slow and own.fast <= SET.same**2 * fast)
