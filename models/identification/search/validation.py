"""How well a model fits records, as candidates are compared by it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from models.identification.fitting.fit import evaluate
from models.identification.kind import Kind
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta

Array = NDArray[np.float64]
Split = tuple[list[Record], list[Record]]

_LEAST = 1e-12  # a cost whose logarithm can be taken


def free_run(kind: Kind) -> int:
    """The criterion on which models are fitted and compared: the free run, or a kind's only one."""
    return kind.criteria - 1


def judged(kind: Kind, records: Sequence[Record], theta: Theta) -> Array:
    """Mean square of the residuals in each of at most forty blocks of neighbours, under the kind's judge that the block
    suits better.
    """
    return np.asarray(np.min([_blocks(evaluate(kind, records, theta, criterion)) for criterion in kind.judges], axis=0))


def judged_cost(kind: Kind, records: Sequence[Record], theta: Theta) -> float:
    """Mean of the blocks."""
    return float(judged(kind, records, theta).mean())


def _blocks(residual: Array) -> Array:
    return np.array(
        [float(part @ part) / len(part) for part in np.array_split(residual, min(SET.blocks, len(residual)))]
    )


def block_costs(kind: Kind, splits: Sequence[Split], thetas: Sequence[Theta]) -> Array:
    """Validation cost for each residual by blocks of neighbours (at most forty a split), as `judged`."""
    return np.concatenate([judged(kind, held, theta) for (_, held), theta in zip(splits, thetas, strict=True)])


def training_cost(kind: Kind, splits: Sequence[Split], thetas: Sequence[Theta]) -> float:
    """Sum of the judged blocks over the training parts."""
    return sum(float(judged(kind, part, theta).sum()) for (part, _), theta in zip(splits, thetas, strict=True))


def ahead(best: Array, other: Array) -> float:
    """How many standard errors of the block-wise difference of validation costs `best` is ahead of `other`."""
    difference = other - best
    mean, count = float(difference.mean()), len(difference)
    error = float(difference.std(ddof=1)) / np.sqrt(count) if count > 1 else np.inf
    if mean == 0:
        return 0.0
    return mean / error if error > 0 else float(np.copysign(np.inf, mean))


def fewest(rows: Sequence[Array], training: Sequence[float]) -> int:
    """The first of `rows`, validation costs by block of ever finer models, that does about as well as the best one.
    Blocks count by the logarithm of their cost and change it by a tenth at most: a slip event that comes
    or stays out is one block, however high. A model that the `training` costs tell clearly need not stand out.
    """
    logs = [np.log(np.maximum(blocks, _LEAST)) for blocks in rows]

    def behind(row: Array, other: Array) -> Array:
        return np.clip(row - other, -SET.one_block, SET.one_block)

    best = int(np.argmin([behind(row, logs[0]).mean() for row in logs]))
    worse = [behind(row, logs[best]) for row in logs]
    told = [training[best] <= (1 - SET.told) * cost for cost in training]
    return next(
        k
        for k, row in enumerate(worse)
        if row.mean() <= SET.shaped or (ahead(np.zeros_like(row), row) < SET.apart and not told[k])
    )
