"""What a model left unexplained while it held, by place and direction: an uneven gut is not what broke it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from controller.signals import Array
from models.checks.usable import counted
from models.identification.kind import Kind
from models.records.record import Record
from models.theta import Theta

STEP_M: Final = 1e-3
"""Length of wall over which what is left counts as one value."""
LEAST: Final = 20
"""Readings that make a value."""


@dataclass(frozen=True)
class LeftOver:
    """Median of measured less predicted about `places` (n,) in m, led `forth` and `back`; 0: too few."""

    places: Array
    forth: Array
    back: Array

    @classmethod
    def of(cls, kind: Kind, record: Record, theta: Theta, driven: str) -> LeftOver:
        """What the model `theta` leaves of `record`, whose capsule is led from the column `driven` on."""
        predicted = np.asarray(kind.predict(record, theta))
        left, rows = kind.measured(record) - predicted, counted(record)
        forth = record[driven] >= predicted
        cells = np.round(predicted / STEP_M).astype(int)
        found = np.arange(cells[rows].min(), cells[rows].max() + 1)
        here = [[rows & (forth == way) & (cells == cell) for cell in found] for way in (True, False)]
        medians = [[float(np.median(left[at])) if at.sum() >= LEAST else 0.0 for at in way] for way in here]
        return cls(found * STEP_M, *(np.array(values) for values in medians))

    def at(self, predicted: Array, led_to: Array) -> Array:
        """Its value for each of the `predicted` places (n,) of a capsule that is led to `led_to` (n,)."""
        values = (np.interp(predicted, self.places, way, 0.0, 0.0) for way in (self.forth, self.back))
        return np.where(led_to >= predicted, *values)
