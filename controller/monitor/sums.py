"""Cumulative sums (Page 1954): evidence for a change that adds up and never falls below none."""

from __future__ import annotations

import math
from dataclasses import dataclass

WIDER = 2.5
"""Of a model that has stopped to hold, by how many times what it predicts is further off than before."""
MOST = 6.0
"""Of one second's evidence, so that no single one raises an alarm."""


@dataclass(slots=True)
class Sum:
    """`value` of the evidence so far and since when, in s, it has not been none; over that time the number of sizes,
    their sum and the sum of each times its number.
    """

    value: float = 0.0
    since_s: float = 0.0
    _count: int = 0
    _total: float = 0.0
    _moment: float = 0.0

    def add(self, evidence: float, began_s: float, size: float = 0.0) -> None:
        """Add what a stretch that began at `began_s` says: more than 0 speaks for a change, here of `size`."""
        if not math.isfinite(evidence + size):
            return
        if self.value <= 0:
            self.since_s = began_s
            self._count, self._total, self._moment = 0, 0.0, 0.0
        self._count += 1
        self._total += size
        self._moment += self._count * size
        self.value = max(self.value + min(evidence, MOST), 0.0)

    @property
    def growth(self) -> float:
        """By how much the size grew since then along its line of least squares, as a share of its mean: 0 of a step, 2
        of what began at nothing.
        """
        n, mean = self._count, self._total / max(self._count, 1)
        if n < 2 or mean <= 0:
            return 0.0
        slope = 12 * (self._moment - 0.5 * (n + 1) * self._total) / (n * (n * n - 1))
        return slope * n / mean


def wider(size: float) -> float:
    """Logarithm of how much likelier `size`, in standard deviations, is where these are `WIDER` times as large."""
    return 0.5 * size * size * (1 - 1 / WIDER**2) - math.log(WIDER)


def shifted(size: float, shift: float) -> float:
    """The same where the mean is `shift` standard deviations above 0."""
    return shift * (size - 0.5 * shift)
