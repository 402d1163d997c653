"""A reference made of positions over time, smooth enough to be followed."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from controller.signals import Array

STEP_S = 1e-3  # of a trajectory's table
LONGEST_S = 3600.0  # of a trajectory: its table is in memory


@dataclass(frozen=True)
class Trajectory:
    """Positions in m at multiples of `STEP_S` from 0, linear between, at rest after the end."""

    places: Array

    def __post_init__(self) -> None:
        if self.places.ndim != 1 or self.places.size < 2 or not np.isfinite(self.places).all():
            raise ValueError(f"places must be two or more finite positions; got shape {self.places.shape}")

    @property
    def end_s(self) -> float:
        """When it comes to rest."""
        return float(STEP_S * (self.places.size - 1))

    def position(self, t: Array) -> Array:
        """Position in m at the times `t` in s, same shape."""
        return np.asarray(np.interp(np.asarray(t, dtype=float) / STEP_S, self._grid, self.places))

    def speed(self, t: Array) -> Array:
        """Speed in m/s at the times `t` in s, same shape."""
        at = np.minimum(np.maximum(np.asarray(t, dtype=float) / STEP_S + (1 + 1e-9), 0.0), float(self.places.size))
        return np.asarray(self._steps[at.astype(np.int64)] / STEP_S)

    @cached_property
    def _grid(self) -> Array:
        """Number of each position (n,)."""
        return np.arange(float(self.places.size))

    @cached_property
    def _steps(self) -> Array:
        """From each position to the next (n + 1,), with the rest before the first and after the last."""
        return np.concatenate([[0.0], np.diff(self.places), [0.0]])


def by_speeds(
    speeds_m_s: Sequence[float], durations_s: Sequence[float], ramp_s: float = 0.05, start_m: float = 0.0
) -> Trajectory:
    """Runs at constant speeds, one after the other; a change of speed takes `ramp_s`."""
    if len(speeds_m_s) != len(durations_s) or not speeds_m_s:
        raise ValueError(f"durations must be as many as speeds, {len(speeds_m_s)}; got {len(durations_s)}")
    if not all(d > 0 for d in durations_s) or not sum(durations_s) <= LONGEST_S:
        raise ValueError(
            f"durations must be positive and at most {LONGEST_S:g} s together; got {list(durations_s)[:8]}"
        )
    speed = np.concatenate(
        [np.full(max(1, round(d / STEP_S)), v) for v, d in zip(speeds_m_s, durations_s, strict=True)]
    )
    width = max(1, round(ramp_s / STEP_S))
    sums = np.cumsum(np.concatenate([np.zeros(width), speed, np.zeros(width)]))
    smooth = (sums[width:] - sums[:-width]) / width
    return Trajectory(start_m + np.concatenate([[0.0], np.cumsum(smooth) * STEP_S]))


def by_places(times_s: Sequence[float], places_m: Sequence[float]) -> Trajectory:
    """Straight from place to place, there at `times_s` from 0 on, corners rounded; counts from the first place."""
    spans = np.maximum(np.round(np.diff(times_s) / STEP_S), 1.0) * STEP_S
    return by_speeds((np.diff(places_m) / spans).tolist(), spans.tolist())


def through(
    places_m: Sequence[float], speed_m_s: float, dwell_s: float, start_s: float, ramp_s: float = 0.05
) -> Trajectory:
    """From 0 to one place after the other, a rest of `dwell_s` at each; the first move begins at `start_s`."""
    if not speed_m_s > 0 or not dwell_s >= 0:
        raise ValueError(f"speed must be positive and dwell zero or more; got {speed_m_s:g} and {dwell_s:g}")
    speeds, durations, here = [0.0], [max(start_s, STEP_S)], 0.0
    for place in places_m:
        ticks = max(1, round(abs(place - here) / speed_m_s / STEP_S))
        speeds += [(place - here) / (ticks * STEP_S), 0.0]
        durations += [ticks * STEP_S, max(dwell_s, STEP_S)]
        here = place
    return by_speeds(speeds, durations, ramp_s)
