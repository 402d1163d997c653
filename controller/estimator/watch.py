"""Whether to believe the belief: what became of the measurements, and when the estimate counts as lost."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from controller.estimator.noise import Noise


@dataclass(slots=True)
class Counts:
    """What became of the measurements."""

    accepted: int = 0
    outliers: int = 0
    unusable: int = 0
    restarts: int = 0


@dataclass(slots=True)
class Watch:
    """Counts positions taken and refused. Many refused in a row mean that the belief is wrong, not they."""

    noise: Noise
    counts: Counts = field(default_factory=Counts)
    accepted_at: float = -math.inf
    refused: int = 0
    proven: int = 0

    def begin(self, now: float) -> None:
        """A new belief, still to be proven."""
        self.refused, self.proven, self.accepted_at = 0, 0, now

    def accept(self, now: float) -> None:
        """A position that fits."""
        self.counts.accepted += 1
        self.refused, self.accepted_at = 0, now
        self.proven += 1

    def refuse(self) -> bool:
        """A position that does not; whether a new belief should begin with it."""
        self.counts.outliers += 1
        self.refused += 1
        wrong = self.refused >= self.noise.patience
        self.counts.restarts += wrong
        return wrong

    def lost(self, now: float, std_m: float) -> bool:
        """Too long without a position, too uncertain, or not proven yet."""
        n = self.noise
        return bool(now - self.accepted_at > n.age_s or not std_m <= n.lost_std_m or self.proven < n.proof)
