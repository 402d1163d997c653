"""References over time: a table of positions, a move to a setpoint, an excursion that interrupts another reference."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from controller.signals import Array, Reference

STEP_S = 1e-3  # of a trajectory's table
LONGEST_S = 3600.0  # of a trajectory: its table is in memory


@dataclass(frozen=True)
class Trajectory:
    """Positions in m at multiples of `STEP_S` from 0, linear between, at rest after the end."""

    positions: Array

    def __post_init__(self) -> None:
        if self.positions.ndim != 1 or self.positions.size < 2 or not np.isfinite(self.positions).all():
            raise ValueError(f"positions must be two or more finite numbers; got shape {self.positions.shape}")

    @property
    def end_s(self) -> float:
        return float(STEP_S * (self.positions.size - 1))

    def position(self, t: Array) -> Array:
        return np.asarray(np.interp(np.asarray(t, dtype=float) / STEP_S, self._grid, self.positions))

    def speed(self, t: Array) -> Array:
        at = np.minimum(np.maximum(np.asarray(t, dtype=float) / STEP_S + (1 + 1e-9), 0.0), float(self.positions.size))
        return np.asarray(self._speeds[at.astype(np.int64)])

    @cached_property
    def _grid(self) -> Array:
        return np.arange(float(self.positions.size))

    @cached_property
    def _speeds(self) -> Array:
        """Speed from each position to the next (n + 1,), 0 before the first and after the last."""
        return np.concatenate([[0.0], np.diff(self.positions), [0.0]]) / STEP_S


def by_speeds(
    speeds_m_s: Sequence[float], durations_s: Sequence[float], ramp_s: float = 0.05, start_m: float = 0.0
) -> Trajectory:
    """Runs at constant speeds in a row; a change of speed takes `ramp_s`."""
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


def by_positions(times_s: Sequence[float], positions_m: Sequence[float]) -> Trajectory:
    """Straight lines through positions at `times_s`, relative to the first, with rounded corners."""
    spans = np.maximum(np.round(np.diff(times_s) / STEP_S), 1.0) * STEP_S
    return by_speeds((np.diff(positions_m) / spans).tolist(), spans.tolist())


def through(
    positions_m: Sequence[float], speed_m_s: float, dwell_s: float, start_s: float, ramp_s: float = 0.05
) -> Trajectory:
    """From 0 to one position after the other with a rest of `dwell_s` at each; the first move begins at `start_s`."""
    if not speed_m_s > 0 or not dwell_s >= 0:
        raise ValueError(f"speed must be positive and dwell zero or more; got {speed_m_s:g} and {dwell_s:g}")
    speeds, durations, here = [0.0], [max(start_s, STEP_S)], 0.0
    for place in positions_m:
        ticks = max(1, round(abs(place - here) / speed_m_s / STEP_S))
        speeds += [(place - here) / (ticks * STEP_S), 0.0]
        durations += [ticks * STEP_S, max(dwell_s, STEP_S)]
        here = place
    return by_speeds(speeds, durations, ramp_s)


@dataclass(frozen=True, slots=True)
class SetpointMove:
    """Phases of constant acceleration: phase k begins at `times[k]` in s at `positions[k]` in m and `speeds[k]` in m/s.
    Its speed changes by `rates[k]` in m/s2; all four (n,). It rests before the first phase.
    """

    times: Array
    positions: Array
    speeds: Array
    rates: Array

    def position(self, t: Array) -> Array:
        k, since = self._phase(t)
        return np.asarray(self.positions[k] + (self.speeds[k] + 0.5 * self.rates[k] * since) * since)

    def speed(self, t: Array) -> Array:
        k, since = self._phase(t)
        return np.where(t < self.times[0], 0.0, self.speeds[k] + self.rates[k] * since)

    def _phase(self, t: Array) -> tuple[Array, Array]:
        k = np.maximum(np.searchsorted(self.times, t, side="right") - 1, 0)
        return k, np.maximum(t - self.times[k], 0.0)


def rest(position_m: float, begin_s: float = 0.0) -> SetpointMove:
    zero = np.zeros(1)
    return SetpointMove(np.array([begin_s]), np.array([position_m]), zero, zero)


def brake(position_m: float, speed_m_s: float, acceleration_m_s2: float, begin_s: float) -> SetpointMove:
    goal = position_m + speed_m_s * abs(speed_m_s) / (2 * acceleration_m_s2)
    return move(goal, position_m, speed_m_s, math.inf, acceleration_m_s2, begin_s)


def move(
    goal_m: float, position_m: float, speed_m_s: float, fastest_m_s: float, acceleration_m_s2: float, begin_s: float
) -> SetpointMove:
    """The quickest move from `position_m` at `speed_m_s` to rest at `goal_m`, no faster than `fastest_m_s`, with
    `acceleration_m_s2` up and down; both are positive. A faster start slows down first; a start that cannot stop before
    the goal overshoots and returns.
    """
    a, way = acceleration_m_s2, goal_m - position_m
    sign = math.copysign(1.0, way - speed_m_s * abs(speed_m_s) / (2 * a))
    v, d = sign * speed_m_s, sign * way
    reached = math.sqrt(max(a * d + 0.5 * v * v, 0.0))
    top = min(reached, fastest_m_s)
    first, last = abs(top - v) / a, top / a
    left = d - 0.5 * (v + top) * first - 0.5 * top * last
    cruise = max(left, 0.0) / top if top > 0 else 0.0
    spans = np.array([first, cruise, last])
    times = begin_s + np.concatenate(([0.0], np.cumsum(spans)))
    rates = sign * np.array([math.copysign(a, top - v), 0.0, -a, 0.0])
    speeds = sign * np.array([v, top, top, 0.0])
    gone = sign * np.cumsum([0.0, 0.5 * (v + top) * first, top * cruise, 0.5 * top * last])
    positions = position_m + gone
    positions[-1] = goal_m
    return SetpointMove(times, positions, speeds, rates)


@dataclass(frozen=True)
class Experiment:
    """Waypoints `places_m` at `times_s`, from 0 at time 0 back to 0, joined by straight lines with rounded corners. It
    runs once the reference rests, from `at_s` of the reference's time on.
    """

    times_s: tuple[float, ...]
    places_m: tuple[float, ...]
    at_s: float

    def __post_init__(self) -> None:
        if len(self.times_s) != len(self.places_m) or len(self.times_s) < 2:
            raise ValueError(
                f"experiment must have as many times as positions, two or more; got {len(self.times_s)} and"
                f" {len(self.places_m)}"
            )
        if self.times_s[0] != 0 or np.any(np.diff(self.times_s) <= 0) or self.places_m[0] or self.places_m[-1]:
            raise ValueError("experiment must go from 0 at time 0 back to 0, at times that grow")

    @property
    def path(self) -> Trajectory:
        return by_positions(self.times_s, self.places_m)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Experiment:
        times, positions = (tuple(map(float, document[name])) for name in ("times_s", "places_m"))
        return cls(times, positions, float(document["at_s"]))

    def document(self) -> dict[str, Any]:
        return {"times_s": list(self.times_s), "places_m": list(self.places_m), "at_s": self.at_s}


@dataclass(frozen=True, slots=True)
class Excursion:
    """The reference `before`, from its rest at `begin_s` `path` out and back, then `before` later by its length."""

    before: Reference
    path: Trajectory
    begin_s: float

    def position(self, t: Array) -> Array:
        return self.before.position(self._spared(t)) + self.path.position(t - self.begin_s)

    def speed(self, t: Array) -> Array:
        inside = (t >= self.begin_s) & (t < self.begin_s + self.path.end_s)
        return np.where(inside, self.path.speed(t - self.begin_s), self.before.speed(self._spared(t)))

    def _spared(self, t: Array) -> Array:
        return np.asarray(t - np.clip(t - self.begin_s, 0.0, self.path.end_s))
