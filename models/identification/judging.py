"""How well a model fits records, as candidates are compared by it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from models.identification.fit import evaluate
from models.identification.kind import Kind
from models.record import Record

Array = NDArray[np.float64]
Split = tuple[list[Record], list[Record]]

_BLOCKS = 40
NEAR_NOISE = 1.5
"""Cost for each residual up to which a fit counts as one that leaves about the noise."""


def middle_stage(kind: Kind) -> int:
    """The stage on which models are compared: corrected enough to forgive teeth out of step, free enough to see every effect."""
    return min(1, kind.stages - 1)


def judged(kind: Kind, records: Sequence[Record], theta: Mapping[str, float]) -> Array:
    """Mean square of the residuals in each of at most forty blocks of neighbours, under the kind's judge that the block suits better."""
    return np.asarray(np.min([_blocks(evaluate(kind, records, theta, stage)) for stage in kind.judges], axis=0))


def judged_cost(kind: Kind, records: Sequence[Record], theta: Mapping[str, float]) -> float:
    """Mean of the blocks."""
    return float(judged(kind, records, theta).mean())


def _blocks(residual: Array) -> Array:
    return np.array([float(part @ part) / len(part) for part in np.array_split(residual, min(_BLOCKS, len(residual)))])


def block_costs(kind: Kind, splits: Sequence[Split], thetas: Sequence[Mapping[str, float]]) -> Array:
    """Validation cost for each residual by blocks of neighbours (at most forty a split), as `judged`."""
    return np.concatenate([judged(kind, held, theta) for (_, held), theta in zip(splits, thetas, strict=True)])


def training_cost(kind: Kind, splits: Sequence[Split], thetas: Sequence[Mapping[str, float]]) -> float:
    """Sum of the judged blocks over the training parts."""
    return sum(float(judged(kind, part, theta).sum()) for (part, _), theta in zip(splits, thetas, strict=True))
