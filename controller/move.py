"""A move that a live setpoint asks for: from where the reference is to a goal, within a speed and an acceleration."""

import math
from dataclasses import dataclass

import numpy as np

from controller.signals import Array


@dataclass(frozen=True, slots=True)
class SetpointMove:
    """A reference of phases with constant acceleration: phase k begins at `times[k]` in s at `places[k]` in m and
    `speeds[k]` in m/s and changes its speed by `rates[k]` in m/s2; all four (n,). Before the first it stands.
    """

    times: Array
    places: Array
    speeds: Array
    rates: Array

    def position(self, t: Array) -> Array:
        """Position in m at the times `t` in s, same shape."""
        k, since = self._phase(t)
        return np.asarray(self.places[k] + (self.speeds[k] + 0.5 * self.rates[k] * since) * since)

    def speed(self, t: Array) -> Array:
        """Speed in m/s at the times `t` in s, same shape."""
        k, since = self._phase(t)
        return np.where(t < self.times[0], 0.0, self.speeds[k] + self.rates[k] * since)

    def _phase(self, t: Array) -> tuple[Array, Array]:
        k = np.maximum(np.searchsorted(self.times, t, side="right") - 1, 0)
        return k, np.maximum(t - self.times[k], 0.0)


def rest(place_m: float, begin_s: float = 0.0) -> SetpointMove:
    """Stay at `place_m`."""
    zero = np.zeros(1)
    return SetpointMove(np.array([begin_s]), np.array([place_m]), zero, zero)


def brake(place_m: float, speed_m_s: float, acceleration_m_s2: float, begin_s: float) -> SetpointMove:
    """From `speed_m_s` to rest."""
    goal = place_m + speed_m_s * abs(speed_m_s) / (2 * acceleration_m_s2)
    return move(goal, place_m, speed_m_s, math.inf, acceleration_m_s2, begin_s)


def move(
    goal_m: float, place_m: float, speed_m_s: float, fastest_m_s: float, acceleration_m_s2: float, begin_s: float
) -> SetpointMove:
    """The quickest move from `place_m` at `speed_m_s` to rest at `goal_m` that is no faster than `fastest_m_s` and
    speeds up and slows down by `acceleration_m_s2`, both positive: to the greatest speed, on with it, to rest. One that
    begins faster slows down first; one that cannot stop before the goal comes back to it.
    """
    a, way = acceleration_m_s2, goal_m - place_m
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
    places = place_m + gone
    places[-1] = goal_m
    return SetpointMove(times, places, speeds, rates)
