"""The table `[reference]`: where the capsule shall go, in mm and mm/s."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from controller.trajectory import STEP_S, Trajectory, by_speeds, through
from plant.reading import choice, from_table

MM: Final = 1e-3


@dataclass(frozen=True)
class Ramp:
    """From `start_s` on at `speed_mm_s`."""

    speed_mm_s: float
    start_s: float = 0.5

    def trajectory(self, duration_s: float) -> Trajectory:
        return by_speeds([0.0, self.speed_mm_s * MM], [max(self.start_s, STEP_S), duration_s])


@dataclass(frozen=True)
class Sine:
    """`amplitude (1 - cos(2 pi f t))/2` from `start_s` on: out and back, at rest at both ends."""

    amplitude_mm: float
    frequency_Hz: float
    start_s: float = 0.5

    def trajectory(self, duration_s: float) -> Trajectory:
        if not self.frequency_Hz > 0:
            raise ValueError(f"reference.frequency_Hz must be positive; got {self.frequency_Hz:g}")
        t = np.maximum(STEP_S * np.arange(round(duration_s / STEP_S) + 2) - self.start_s, 0.0)
        return Trajectory(0.5 * self.amplitude_mm * MM * (1 - np.cos(2 * np.pi * self.frequency_Hz * t)))


@dataclass(frozen=True)
class Steps:
    """To one of `positions_mm` after the other at `speed_mm_s`, a rest of `dwell_s` at each."""

    positions_mm: tuple[float, ...]
    speed_mm_s: float
    dwell_s: float = 1.0
    start_s: float = 0.5

    def trajectory(self, duration_s: float) -> Trajectory:
        return through([MM * p for p in self.positions_mm], MM * self.speed_mm_s, self.dwell_s, self.start_s)


@dataclass(frozen=True)
class Hold:
    """To `position_mm` at `speed_mm_s`, then stay there."""

    position_mm: float = 0.0
    speed_mm_s: float = 2.0
    start_s: float = 0.5

    def trajectory(self, duration_s: float) -> Trajectory:
        return through([MM * self.position_mm], MM * self.speed_mm_s, 0.0, self.start_s)


@dataclass(frozen=True)
class Waypoints:
    """`positions_mm` at `times_s`, straight lines between; corners are rounded over 50 ms."""

    times_s: tuple[float, ...]
    positions_mm: tuple[float, ...]

    def trajectory(self, duration_s: float) -> Trajectory:
        times, places = np.array([0.0, *self.times_s]), MM * np.array([0.0, *self.positions_mm])
        if len(self.times_s) != len(self.positions_mm) or not self.times_s or np.any(np.diff(times) < STEP_S):
            raise ValueError(
                f"reference.times_s must be above 0, increase and be as many as positions_mm; got {list(self.times_s)[:8]} "
                f"and {len(self.positions_mm)} positions"
            )
        spans = np.maximum(np.round(np.diff(times) / STEP_S), 1.0) * STEP_S
        return by_speeds((np.diff(places) / spans).tolist(), spans.tolist())


REFERENCES: Final[Mapping[str, Callable[..., Any]]] = {
    "ramp": Ramp,
    "sine": Sine,
    "steps": Steps,
    "hold": Hold,
    "waypoints": Waypoints,
}


def read_reference(table: Mapping[str, Any], duration_s: float) -> Trajectory:
    """The reference that a scenario's table asks for, over `duration_s`. Raises ValueError as `plant.reading.from_table`."""
    kind = choice(table, "reference.kind", tuple(REFERENCES))
    shape = from_table(REFERENCES[kind], table, "reference", skip=("kind",))  # type: ignore[arg-type]
    trajectory: Trajectory = shape.trajectory(duration_s)
    return trajectory
