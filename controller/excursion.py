"""A motion there and back that interrupts a reference where it rests: a short experiment while a controller leads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from controller.signals import Array, Reference
from controller.trajectory import Trajectory, by_places


@dataclass(frozen=True)
class Experiment:
    """Waypoints `places_m` at `times_s`, from 0 at time 0 back to 0, straight between with rounded corners; to be
    driven once the reference rests, from `at_s` of its time on.
    """

    times_s: tuple[float, ...]
    places_m: tuple[float, ...]
    at_s: float

    def __post_init__(self) -> None:
        if len(self.times_s) != len(self.places_m) or len(self.times_s) < 2:
            raise ValueError(
                f"experiment must have as many times as places, two or more; got {len(self.times_s)} and"
                f" {len(self.places_m)}"
            )
        if self.times_s[0] != 0 or np.any(np.diff(self.times_s) <= 0) or self.places_m[0] or self.places_m[-1]:
            raise ValueError("experiment must go from 0 at time 0 back to 0, at times that grow")

    @property
    def path(self) -> Trajectory:
        """The motion."""
        return by_places(self.times_s, self.places_m)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Experiment:
        """From the record beside a log."""
        times, places = (tuple(map(float, document[name])) for name in ("times_s", "places_m"))
        return cls(times, places, float(document["at_s"]))

    def document(self) -> dict[str, Any]:
        """For the record beside a log."""
        return {"times_s": list(self.times_s), "places_m": list(self.places_m), "at_s": self.at_s}


@dataclass(frozen=True, slots=True)
class Excursion:
    """`before`, which rests at `begin_s`, then `path` there and back, then `before`, by as much later."""

    before: Reference
    path: Trajectory
    begin_s: float

    def position(self, t: Array) -> Array:
        """Position in m at the times `t` in s, same shape."""
        return self.before.position(self._spared(t)) + self.path.position(t - self.begin_s)

    def speed(self, t: Array) -> Array:
        """Speed in m/s at the times `t` in s, same shape."""
        inside = (t >= self.begin_s) & (t < self.begin_s + self.path.end_s)
        return np.where(inside, self.path.speed(t - self.begin_s), self.before.speed(self._spared(t)))

    def _spared(self, t: Array) -> Array:
        return np.asarray(t - np.clip(t - self.begin_s, 0.0, self.path.end_s))
