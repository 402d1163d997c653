"""A model in the middle of a search: its fits on the splits' training parts, and how well they fit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TypeVar

import numpy as np

from models.identification.fitting.fit import judged, judged_cost
from models.identification.fitting.fitter import Fitter
from models.identification.kind import Array, Kind, Split
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta
from models.workers import each

_Item = TypeVar("_Item")


@dataclass(frozen=True)
class FittedModel:
    """The model of `kind` with `effects`, fitted to the training part of each of `splits`: `thetas`, one a split. Where
    `allowed`, a fit is that point of those that its training part allows which predicts the held one best: with stick
    and slip, a base that is as far off as the noise leaves it shifts every later slip event.
    """

    kind: Kind
    splits: Sequence[Split]
    effects: tuple[str, ...] = ()
    thetas: tuple[Theta, ...] = ()
    allowed: bool = False

    def fitted(self, thetas: Iterable[Theta], effects: Sequence[str] | None = None) -> FittedModel:
        """The same model with other fits; with other effects where given."""
        return replace(self, thetas=tuple(thetas), effects=self.effects if effects is None else tuple(effects))

    def near(self, starts: Iterable[Theta], effects: Sequence[str] | None = None) -> FittedModel:
        """The same model fitted from close by `starts`, one a split; with other effects where given."""
        return self.far(([start] for start in starts), effects, seeds=0)

    def far(
        self, starts: Iterable[Sequence[Theta]], effects: Sequence[str] | None = None, seeds: int = SET.seeds
    ) -> FittedModel:
        """The same from anywhere, several starts a split."""
        chosen = self.effects if effects is None else tuple(effects)
        found = list[Theta]()
        for (part, held), some in zip(self.splits, starts, strict=True):
            fitter = Fitter.of(self.kind, part, chosen)
            fit = fitter.far(some, seeds=seeds)
            likely = fitter.allowed(fit) if self.allowed else []
            found.append(min(likely, key=partial(judged_cost, self.kind, held), default=fit.theta))
        return self.fitted(found, chosen)

    def each(self, fit: Callable[[_Item], FittedModel], items: Sequence[_Item]) -> list[FittedModel]:
        """`fit` of every item, side by side; only values come back, for a kind and its records stay where they are."""

        def values(item: _Item) -> tuple[tuple[str, ...], tuple[Theta, ...]]:
            found = fit(item)
            return found.effects, found.thetas

        return [self.fitted(thetas, effects) for effects, thetas in each(values, items)]

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
    def training_blocks(self) -> Array:
        """`blocks` of the training parts."""
        return np.concatenate([judged(self.kind, part, theta) for part, theta in self.parts])

    @property
    def training_cost(self) -> float:
        """Sum of these."""
        return float(self.training_blocks.sum())


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
    block, however high. A model that clearly lowers the `training` cost need not lead by standard errors; one whose
    validation cost rises clearly is not the best.
    """
    logs = [np.log(np.maximum(blocks, SET.tiny)) for blocks in rows]

    def behind(row: Array, other: Array) -> Array:
        return np.clip(row - other, -SET.one_block, SET.one_block)

    rises = [np.clip(row - logs[0], -1, 1).mean() > SET.one_block for row in logs]
    means = [np.inf if up else behind(row, logs[0]).mean() for row, up in zip(logs, rises, strict=True)]
    best = int(np.argmin(means))
    worse = [behind(row, logs[best]) for row in logs]
    clear = [training[best] <= (1 - SET.finer_gain) * cost for cost in training]
    return next(
        k
        for k, row in enumerate(worse)
        if row.mean() <= SET.shaped or (ahead(np.zeros_like(row), row) < SET.apart and not clear[k])
    )
