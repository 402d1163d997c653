"""Fits on ever longer beginnings of the records, from many places: over a few teeth of stick and slip a wrong base is a little late, over
many it is out of step, and least squares sees no way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from models.effects import BY_ID
from models.identification.fit import NARROW, Axis, Fit, axes, evaluate_all, narrowing
from models.identification.kind import Kind
from models.record import Record

_BEGINNINGS_S = (2.0, 5.0, 12.0, 28.0)
_ROUNDS = 6
_OFF = 0.2  # of a nominal value, what a base may be off by
_DOUBLINGS = 5.5  # of an amplitude's probe
_NEAR = 3.0  # scales around a start


@dataclass(frozen=True)
class Effort:
    """How many places to look at, and how many of them to go down from at each length, the whole records last."""

    places: int
    kept: tuple[int, ...]


THOROUGH = Effort(512, (16, 6, 3, 2, 1))
QUICK = Effort(256, (8, 4, 2, 1, 1))


def lengthening(
    kind: Kind,
    records: Sequence[Record],
    effects: Sequence[str],
    starts: Sequence[Mapping[str, float]],
    stage: int,
    effort: Effort = THOROUGH,
    fresh: str = "",
) -> Fit:
    """The best fit on the whole records. At every length the starts stand beside what the shorter ones led to, for what a short one
    does not show it cannot tell. Of the effect `fresh` not even the size is known."""
    places = [dict(start) for start in starts]
    points = places + _scattered(kind, effects, places, effort.places, fresh)
    for length, kept in zip((*_BEGINNINGS_S, np.inf), effort.kept, strict=True):
        parts = [_beginning(record, length) for record in records]
        if length < np.inf and all(len(part) == len(record) for part, record in zip(parts, records, strict=True)):
            continue
        costs = [float(r @ r) for r in evaluate_all(kind, parts, points, stage)]
        best = [points[i] for i in np.argsort(costs, kind="stable")[:kept]]
        fits = [narrowing(kind, parts, effects, point, stage, NARROW, _ROUNDS) for point in best]
        fits.sort(key=lambda fit: fit.cost)
        points = [fit.theta for fit in fits] + places
    return fits[0]


def _beginning(record: Record, length: float) -> Record:
    t = record["t_s"]
    return record.rows(slice(0, int(np.searchsorted(t, t[0] + length))))


def _scattered(
    kind: Kind, effects: Sequence[str], starts: Sequence[Mapping[str, float]], count: int, fresh: str
) -> list[dict[str, float]]:
    """Places around the nominal base and close to the starts' effects, with amplitudes of every size of the one that is `fresh`."""
    moved = axes(kind, effects)
    shares = qmc.Sobol(len(moved), seed=0).random(count) if moved else np.zeros((0, 0))
    return [
        {**start, **{axis.name: _place(axis, start, share, fresh) for axis, share in zip(moved, row, strict=True)}}
        for start, row in ((starts[i % len(starts)], row) for i, row in enumerate(shares))
    ]


def _place(axis: Axis, start: Mapping[str, float], share: float, fresh: str) -> float:
    """The value of one parameter for a number `share` between 0 and 1."""
    p = axis.parameter
    effect, _, name = axis.name.rpartition(".")
    if not effect:
        value = p.value * (1 + _OFF * (2 * share - 1))
    elif effect == fresh and name == BY_ID[effect].amplitude().name:
        sign, size = np.sign(share - 0.5) or 1.0, abs(2 * share - 1)
        value = sign * BY_ID[effect].probe * 2 ** (_DOUBLINGS * size)
        value = value if p.lower <= value <= p.upper else -value
    else:
        value = start.get(axis.name, p.value)
        reach = min(p.spread, max(_NEAR * axis.scale, _NEAR / 10 * abs(value)))
        value += reach * (2 * share - 1)
    return float(np.clip(value, p.lower, p.upper))
