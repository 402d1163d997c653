"""Where fits from anywhere begin: points around starts, and prefixes of records that grow."""

from collections.abc import Iterator, Sequence
from itertools import cycle

import numpy as np
import scipy

from models.checks.usable import lead_in_s
from models.identification.fitting.fit import FreeParameter, judged_cost
from models.identification.kind import Kind
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


def lengths(kind: Kind, records: Sequence[Record]) -> Iterator[tuple[int, list[Record]]]:
    """Number of a length and records cut to it, the whole ones last."""
    first = 0 if kind.beginnings_s else len(SET.kept) - 1  # a table has no other than the last
    for number, length in enumerate((*kind.beginnings_s, np.inf), first):
        parts = prefixes(records, length)
        if length == np.inf or any(len(part) < len(record) for part, record in zip(parts, records, strict=True)):
            yield number, parts


def prefixes(records: Sequence[Record], length: float) -> list[Record]:
    """The first `length` s of each record that count, and the rows before."""
    return [r.beginning(length + lead_in_s(r)) if length < np.inf else r for r in records]


def predictable(
    kind: Kind, held: Sequence[Record], theta: Theta, most: float, rng: np.random.Generator
) -> tuple[float, float]:
    """The longest prefixes in s (inf: whole records) of records like `held` over which the model at `theta` predicts
    itself with the base 0.1 % off at a cost below `most`, and that cost: where one early slip event shifts all that
    follow, no fit can do better.
    """
    fitted, made = {p.key for p in kind.base if p.fit}, list[list[Record]]()
    for _ in range(SET.self_imitations):
        off = {name: theta[name] * (1 + SET.thousandth * rng.choice((-1, 1))) for name in theta if name in fitted}
        made.append([kind.imitate(record, theta | off, rng) for record in held])
    for length in (np.inf, *reversed(kind.beginnings_s[1:])):  # the first holds too few slip events to judge by
        cost = max(judged_cost(kind, prefixes(records, length), theta) for records in made)
        if cost < most:
            break
    return length, cost


def scattered(
    kind: Kind, moved: Sequence[FreeParameter], starts: Sequence[Theta], count: int, seed: int, fresh: str = ""
) -> list[Theta]:
    """So many points around the nominal base and the effects of `starts`; with every size of the effect `fresh`."""
    shares = scipy.stats.qmc.Sobol(len(moved), seed=seed).random(count) if moved else ()
    return [
        start | {axis.name: _place(kind, axis, start, share, fresh) for axis, share in zip(moved, row, strict=True)}
        for start, row in zip(cycle(starts), shares, strict=False)
    ]


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
        reach = min(p.spread, max(SET.near_start * axis.scale, SET.near_share * abs(value)))
        value += reach * (2 * share - 1)
    return float(np.clip(value, p.lower, p.upper))
