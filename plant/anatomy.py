"""Properties that vary along the lumen: a profile of the hoop stress, stated or random."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from plant.compiling import compiled
from plant.layout import P_PROFILE_START, P_PROFILE_STEP
from plant.tables import Floats


@dataclass(frozen=True)
class Anatomy:
    """A factor on the hoop stress, `level[k]` at `start_m + k step_m`, linear between, constant outside."""

    level: tuple[float, ...] = (1.0,)
    start_m: float = 0.0
    step_m: float = 1e-3

    def __post_init__(self) -> None:
        if not self.level or min(self.level) <= 0 or not np.all(np.isfinite(self.level)):
            raise ValueError(f"anatomy level must be positive numbers; got {list(self.level)[:8]}")
        if self.step_m <= 0:
            raise ValueError(f"anatomy step_m must be positive; got {self.step_m:g}")

    def times(self, other: Anatomy) -> Anatomy:
        """The product of both profiles, on a grid of a quarter millimetre."""
        ends = [(a.start_m, a.start_m + a.step_m * (len(a.level) - 1)) for a in (self, other)]
        x = np.arange(min(e[0] for e in ends), max(e[1] for e in ends) + 2.5e-4, 2.5e-4)
        return Anatomy(tuple(self.at(x) * other.at(x)), float(x[0]), 2.5e-4)

    def at(self, x: Floats) -> Floats:
        grid = self.start_m + self.step_m * np.arange(len(self.level))
        return np.asarray(np.interp(x, grid, self.level))


def along(places_m: Sequence[float], levels: Sequence[float], step_m: float = 2.5e-4) -> Anatomy:
    """A profile through the given points, linear between them; positions must increase."""
    if len(places_m) != len(levels) or len(places_m) < 2 or np.any(np.diff(places_m) <= 0):
        raise ValueError(
            f"anatomy places_m must increase and match level, two points or more; got {list(places_m)} and"
            f" {list(levels)}"
        )
    x = np.arange(places_m[0], places_m[-1] + step_m, step_m)
    return Anatomy(tuple(np.interp(x, places_m, levels)), float(places_m[0]), step_m)


def random_anatomy(
    seed: int, start_m: float = -0.1, end_m: float = 0.3, spread: float = 0.15, correlation_m: float = 12e-3
) -> Anatomy:
    """A gut drawn with `seed`: a log-normal level field of standard deviation `spread` and correlation length
    `correlation_m`, with folds of 5 to 10 mm, a slow taper and sometimes a stenosis.
    """
    if not 0 <= spread <= 0.5:
        raise ValueError(f"spread must lie in [0, 0.5]; got {spread:g}")
    rng = np.random.default_rng(seed)
    step = 2.5e-4
    x = np.arange(start_m, end_m + step, step)
    reach = np.arange(-4 * correlation_m, 4 * correlation_m + step, step)
    kernel = np.exp(-2 * (reach / correlation_m) ** 2)
    field = np.convolve(rng.standard_normal(x.size + reach.size - 1), kernel / np.sqrt(np.sum(kernel**2)), mode="valid")
    log_level = spread * (
        field
        + 0.5 * np.sin(2 * np.pi * (x / rng.uniform(5e-3, 10e-3) + rng.random()))
        + rng.normal() * (x - x[0]) / (x[-1] - x[0])
    )
    if rng.random() < 0.4:
        log_level += 0.4 * np.exp(-(((x - rng.uniform(start_m, end_m)) / rng.uniform(3e-3, 6e-3)) ** 4))
    return Anatomy(tuple(np.exp(log_level)), start_m, step)


@compiled
def profile_level(x: float, p: Floats, profile: Floats) -> float:
    last = profile.shape[0] - 1
    if last == 0:
        return float(profile[0])
    place = (x - p[P_PROFILE_START]) / p[P_PROFILE_STEP]
    if place <= 0.0:
        return float(profile[0])
    if place >= last:
        return float(profile[last])
    node = int(place)
    return float(profile[node] + (profile[node + 1] - profile[node]) * (place - node))
