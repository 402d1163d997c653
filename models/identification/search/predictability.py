"""How far ahead a model predicts itself: where one slip event that comes a little early moves all that follow, free
runs soon tell nothing.
"""

from collections.abc import Sequence

import numpy as np

from models.identification.kind import Kind
from models.identification.search.growing_horizon import prefixes
from models.identification.search.validation import Split, judged_cost
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


def sensitivity_cost(kind: Kind, splits: Sequence[Split], theta: Theta, rng: np.random.Generator) -> float:
    """Validation cost that the model leaves of itself, with noise, where the base's numbers are 0.1 % off: what
    no fit can do better than.
    """
    _, held = splits[0]
    return _of_itself(kind, _moved(kind, held, theta, rng), theta)


def predictable(
    kind: Kind, splits: Sequence[Split], theta: Theta, most: float, rng: np.random.Generator
) -> tuple[float, list[Split]]:
    """The longest beginnings of the records, in s (inf: whole ones), over which the model leaves less than `most` of
    itself, and the splits cut to them.
    """
    _, held = splits[0]
    imitated = _moved(kind, held, theta, rng)
    for length in (np.inf, *reversed(kind.beginnings_s[1:])):  # the first holds too few slip events to judge by
        cut = [prefixes(records, length) for records in imitated]
        if _of_itself(kind, cut, theta) < most:
            break
    return length, [(prefixes(part, length), prefixes(rest, length)) for part, rest in splits]


def _moved(kind: Kind, held: Sequence[Record], theta: Theta, rng: np.random.Generator) -> list[list[Record]]:
    """Imitations of the records `held` on the model with each base number 0.1 % up or down."""
    fitted = {p.key for p in kind.base if p.fit}
    moved = (
        theta | {name: theta[name] * (1 + SET.thousandth * rng.choice((-1, 1))) for name in theta if name in fitted}
        for _ in range(SET.self_imitations)
    )
    return [[kind.imitate(record, point, rng) for record in held] for point in moved]


def _of_itself(kind: Kind, imitated: Sequence[Sequence[Record]], theta: Theta) -> float:
    return max(judged_cost(kind, records, theta) for records in imitated)
