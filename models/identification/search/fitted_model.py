"""A model in the middle of a search: what it has beyond the base, its fits on the splits' training parts, and how well
these fit the held-out parts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from models.identification.kind import Kind
from models.identification.search.validation import Array, Split, block_costs, training_cost
from models.records.record import Record
from models.theta import Theta

Fits = Sequence[Theta]


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

    def fitted(self, thetas: Fits, effects: Sequence[str] | None = None) -> FittedModel:
        """The same model with other fits, of other effects where these are given."""
        return replace(self, thetas=tuple(thetas), effects=self.effects if effects is None else tuple(effects))

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
        """Validation cost for each residual by block."""
        return block_costs(self.kind, self.splits, self.thetas)

    @property
    def cost(self) -> float:
        """Mean square of the validation residuals over the splits."""
        return float(np.mean(self.blocks))

    @cached_property
    def training_cost(self) -> float:
        """Sum of the judged blocks over the training parts."""
        return training_cost(self.kind, self.splits, self.thetas)
