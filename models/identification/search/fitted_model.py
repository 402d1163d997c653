"""A model in the middle of a search: its fits on the splits' training parts, and how well they fit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from models.identification.fitting.fit import evaluate
from models.identification.kind import Array, Kind, Split
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta

Fits = Sequence[Theta]
Fitting = Callable[[Kind, Sequence[Record], Sequence[str], Any], Theta]
"""A function that fits the base with effects to records, from a start (or several)."""
_LEAST = 1e-12  # a cost whose logarithm can be taken


def judged(kind: Kind, records: Sequence[Record], theta: Theta) -> Array:
    """Mean square of the residuals in each of at most forty blocks, under the kind's judge that suits it better."""

    def blocks(residual: Array) -> list[float]:
        parts = np.array_split(residual, min(SET.blocks, len(residual)))
        return [float(part @ part) / len(part) for part in parts]

    rows = [blocks(evaluate(kind, records, theta, criterion)) for criterion in kind.judges]
    return np.asarray(np.min(rows, axis=0))


def judged_cost(kind: Kind, records: Sequence[Record], theta: Theta) -> float:
    """Mean of the blocks."""
    return float(judged(kind, records, theta).mean())


@dataclass(frozen=True)
class FittedModel:
    """The model of `kind` with `effects`, fitted to the training part of each of `splits`: `thetas`, one a split."""

    kind: Kind
    splits: Sequence[Split]
    effects: tuple[str, ...]
    thetas: tuple[Theta, ...]

    @classmethod
    def of(cls, kind: Kind, splits: Sequence[Split], effects: Sequence[str], thetas: Fits) -> FittedModel:
        """The model from any sequences."""
        return cls(kind, splits, tuple(effects), tuple(thetas))

    def fitted(self, thetas: Iterable[Theta], effects: Sequence[str] | None = None) -> FittedModel:
        """The same model with other fits; with other effects where given."""
        return replace(self, thetas=tuple(thetas), effects=self.effects if effects is None else tuple(effects))

    def refitted(self, fit: Fitting, starts: Iterable[Any], effects: Sequence[str] | None = None) -> FittedModel:
        """The same model refitted by `fit` from `starts`, one a split; with other effects where given."""
        chosen = self.effects if effects is None else tuple(effects)
        pairs = zip(self.splits, starts, strict=True)
        return self.fitted((fit(self.kind, part, chosen, start) for (part, _), start in pairs), chosen)

    @property
    def part(self) -> list[Record]:
        """The first split's training records."""
        return self.splits[0][0]

    @property
    def parts(self) -> Iterator[tuple[list[Record], Theta]]:
        """Each split's training records with the fit to them."""
        return zip((part for part, _ in self.splits), self.thetas, strict=True)

    @cached_property
    def blocks(self) -> Array:
        """Validation cost for each residual by blocks of neighbours (at most forty a split), as `judged`."""
        rows = zip(self.splits, self.thetas, strict=True)
        return np.concatenate([judged(self.kind, held, theta) for (_, held), theta in rows])

    @property
    def cost(self) -> float:
        """Mean square of the validation residuals over the splits."""
        return float(np.mean(self.blocks))

    @cached_property
    def _trained(self) -> list[Array]:
        return [judged(self.kind, part, theta) for part, theta in self.parts]

    @property
    def training_blocks(self) -> Array:
        """The same of the training parts."""
        return np.concatenate(self._trained)

    @property
    def training_cost(self) -> float:
        """Sum of these."""
        return sum(float(blocks.sum()) for blocks in self._trained)


def ahead(best: Array, other: Array) -> float:
    """By how many standard errors of the block-wise difference of validation costs `best` leads `other`."""
    difference = other - best
    mean, count = float(difference.mean()), len(difference)
    error = float(difference.std(ddof=1)) / np.sqrt(count) if count > 1 else np.inf
    if mean == 0:
        return 0.0
    return mean / error if error > 0 else float(np.copysign(np.inf, mean))


def fewest(rows: Sequence[Array], training: Sequence[float]) -> int:
    """The first of `rows`, validation costs by block of ever finer models, that does about as well as the best one.
    Blocks count by the logarithm of their cost, which changes by a tenth at most: a slip event more or less is one
    block, however high. A model that clearly lowers the `training` cost need not lead by standard errors.
    """
    logs = [np.log(np.maximum(blocks, _LEAST)) for blocks in rows]

    def behind(row: Array, other: Array) -> Array:
        return np.clip(row - other, -SET.one_block, SET.one_block)

    best = int(np.argmin([behind(row, logs[0]).mean() for row in logs]))
    worse = [behind(row, logs[best]) for row in logs]
    clear = [training[best] <= (1 - SET.finer_gain) * cost for cost in training]
    return next(
        k
        for k, row in enumerate(worse)
        if row.mean() <= SET.shaped or (ahead(np.zeros_like(row), row) < SET.apart and not clear[k])
    )
