"""Forces between a body, its inner mass on a spring, and the plate; compiled, with the numbers of the drive in one record."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb

GRAVITY = 9.81
DRY_SPEED = 2.0e-3  # m/s, below it dry friction of the inner mass's guide counts as creep
TRAVEL_M = 0.03  # beyond it the coil's reach and the spring's hardening stay what they are there


class VibroCycle(NamedTuple):
    """Numbers of the drive, SI; everything after `coulomb_N` is beyond the base model and absent at its default."""

    body_kg: float
    inner_kg: float
    stiffness: float
    force_N: float
    coulomb_N: float
    reaction: float = 1.0
    damping: float = 0.0
    dry_N: float = 0.0
    cubic: float = 0.0
    stop_stiffness: float = 0.0
    stop_gap_m: float = 1.0
    current_lag_s: float = 0.0
    force_lag_s: float = 0.0
    reach_per_m: float = 0.0
    asymmetry: float = 0.0
    incline_N: float = 0.0
    drag_N: float = 0.0
    drag_power: float = 1.0
    stribeck: float = 0.0
    stribeck_speed: float = 0.003


@nb.njit(cache=True, inline="always")
def suspension_force(stretch: float, rate: float, q: VibroCycle) -> float:
    """Pull of the suspension on the inner mass towards the body in N: spring, damping, guide, stops."""
    inside = min(abs(stretch), TRAVEL_M)
    force = (q.stiffness + q.cubic * inside * inside) * stretch + q.damping * rate
    if q.dry_N != 0.0:
        force += q.dry_N * rate / math.sqrt(rate * rate + DRY_SPEED * DRY_SPEED)
    if stretch > q.stop_gap_m:
        force += q.stop_stiffness * (stretch - q.stop_gap_m)
    elif stretch < -q.stop_gap_m:
        force += q.stop_stiffness * (stretch + q.stop_gap_m)
    return force


@nb.njit(cache=True, inline="always")
def drive_force(on: float, stretch: float, q: VibroCycle) -> float:
    """The coil's force on the inner mass in N; `on` is its share of the full one."""
    if q.reach_per_m == 0.0:
        return q.force_N * on
    return q.force_N * on * math.exp(q.reach_per_m * min(max(stretch, -TRAVEL_M), TRAVEL_M))


@nb.njit(cache=True, inline="always")
def friction(speed: float, direction: int, q: VibroCycle) -> float:
    """Coulomb friction in N of a body that moves, or would move, in `direction` (+1, -1) at `speed` >= 0."""
    level = 1.0 + q.asymmetry * direction
    if q.stribeck != 0.0:
        level *= 1.0 + q.stribeck * math.exp(-((speed / q.stribeck_speed) ** 2))
    return q.coulomb_N * max(level, 0.0)


@nb.njit(cache=True, inline="always")
def resistance(v: float, q: VibroCycle) -> float:
    """Resistance in N that grows with the body's speed, along -v."""
    if q.drag_N == 0.0:
        return 0.0
    return math.copysign(q.drag_N * (abs(v) / 0.01) ** q.drag_power, v)
