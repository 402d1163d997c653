"""How far a model predicts itself: where one early slip event shifts all that follow, long free runs say little."""

from collections.abc import Sequence

import numpy as np

from models.identification.fitting.fit import judged_cost
from models.identification.fitting.horizon import prefixes
from models.identification.kind import Kind, Split
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


def sensitivity_cost(kind: Kind, splits: Sequence[Split], theta: Theta, rng: np.random.Generator) -> float:
    """Validation cost of the model against itself with the base 0.1 % off: no fit can do better."""
    return max(judged_cost(kind, records, theta) for records in _off(kind, splits[0][1], theta, rng))


def predictable(
    kind: Kind, splits: Sequence[Split], theta: Theta, most: float, rng: np.random.Generator
) -> tuple[float, list[Split]]:
    """The longest prefixes of the records in s (inf: whole records) over which the model predicts itself with a cost
    below `most`, and the splits cut to them.
    """
    imitated = _off(kind, splits[0][1], theta, rng)
    for length in (np.inf, *reversed(kind.beginnings_s[1:])):  # the first holds too few slip events to judge by
        if max(judged_cost(kind, prefixes(records, length), theta) for records in imitated) < most:
            break
    return length, [(prefixes(part, length), prefixes(rest, length)) for part, rest in splits]


def _off(kind: Kind, held: Sequence[Record], theta: Theta, rng: np.random.Generator) -> list[list[Record]]:
    """Imitations of the records `held` on the model with each base number 0.1 % up or down."""
    fitted = {p.key for p in kind.base if p.fit}
    moved = (
        theta | {name: theta[name] * (1 + SET.thousandth * rng.choice((-1, 1))) for name in theta if name in fitted}
        for _ in range(SET.self_imitations)
    )
    return [[kind.imitate(record, point, rng) for record in held] for point in moved]
