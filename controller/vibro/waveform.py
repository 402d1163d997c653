"""A periodic drive: levels of the coil's force over the parts of a cycle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from controller.signals import Array

_TINY = 1e-12  # share of a cycle below which a part is rounding


@dataclass(frozen=True)
class Waveform:
    """The command `levels[i]` (0 to 1, share of the full force) from the fraction `edges[i]` to `edges[i + 1]` of each
    `period_s`. `edges` (n + 1,) rise from 0 to 1, `levels` (n,). Raises ValueError for a period not above 0, edges that
    do not rise from 0 to 1 or levels outside [0, 1].
    """

    period_s: float
    edges: tuple[float, ...]
    levels: tuple[float, ...]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.period_s) and self.period_s > 0):
            raise ValueError(f"period_s must be above 0; got {self.period_s:g}")
        if len(self.edges) != len(self.levels) + 1 or len(self.levels) == 0:
            raise ValueError(f"edges must be one more than levels; got {len(self.edges)} and {len(self.levels)}")
        if self.edges[0] != 0 or self.edges[-1] != 1 or not all(a < b for a, b in pairwise(self.edges)):
            raise ValueError(f"edges must rise from 0 to 1; got {self.edges}")
        wrong = next((level for level in self.levels if not 0 <= level <= 1), None)
        if wrong is not None:
            raise ValueError(f"levels must lie in [0, 1]; got {wrong:g}")

    @classmethod
    def square(cls, period_s: float, duty: float, amplitude: float = 1.0) -> Waveform:
        """`amplitude` first, for the share `duty` of the period, then 0."""
        if not 0 <= duty <= 1:
            raise ValueError(f"duty must lie in [0, 1]; got {duty:g}")
        if duty in (0.0, 1.0):
            return cls(period_s, (0.0, 1.0), (amplitude * duty,))
        return cls(period_s, (0.0, duty, 1.0), (amplitude, 0.0))

    @classmethod
    def even(cls, period_s: float, levels: Array) -> Waveform:
        """`levels` (n,) over n equal parts of the period, clipped into [0, 1]."""
        inside = np.clip(np.asarray(levels, dtype=float), 0.0, 1.0)
        return cls(period_s, (*(i / inside.size for i in range(inside.size)), 1.0), tuple(inside.tolist()))

    def mean(self, start: float, end: float) -> float:
        """Mean level between two fractions of a cycle: an edge inside a tick keeps its impulse."""
        if end - start < _TINY:
            return self.levels[min(int(np.searchsorted(self.edges, start, side="right")) - 1, len(self.levels) - 1)]
        total = 0.0
        for (low, high), level in zip(pairwise(self.edges), self.levels, strict=True):
            total += level * max(min(high, end) - max(low, start), 0.0)
        return total / (end - start)

    def sampled(self, n: int) -> Array:
        """Mean level in each of `n` equal parts of the cycle, (n,)."""
        edges = np.asarray(self.edges)
        area = np.concatenate(([0.0], np.cumsum(np.asarray(self.levels) * np.diff(edges))))
        at = np.interp(np.arange(n + 1) / n, edges, area)
        return np.asarray(np.diff(at) * n)

    def scaled(self, factor: float) -> Waveform:
        """The same with all levels times `factor`, clipped into [0, 1]."""
        return Waveform(self.period_s, self.edges, tuple(min(max(level * factor, 0.0), 1.0) for level in self.levels))

    def flipped(self) -> Waveform:
        """The levels mirrored below their highest: on a linear spring the body moves as far in the other direction."""
        top = max(self.levels)
        return Waveform(self.period_s, self.edges, tuple(top - level for level in self.levels))


def blend(a: Waveform, b: Waveform, share: float, parts: int = 48) -> Waveform:
    """Between `a` (share 0) and `b` (share 1): period in geometric, levels part by part in linear proportion."""
    if share <= 0:
        return a
    if share >= 1:
        return b
    period = a.period_s ** (1 - share) * b.period_s**share
    if a.edges == b.edges:
        return Waveform(
            period, a.edges, tuple((1 - share) * p + share * q for p, q in zip(a.levels, b.levels, strict=True))
        )
    return Waveform.even(period, (1 - share) * a.sampled(parts) + share * b.sampled(parts))


REST = Waveform(0.02, (0.0, 1.0), (0.0,))
