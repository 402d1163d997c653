"""Body and inner mass on a plate under a periodic on/off drive, compiled: forces, exact stick and slip, mean velocity.

All of it is one file on purpose: code that was compiled once is found again by the file's own date.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from models.drives.vibro_numbers import VibroCycle

Array = NDArray[np.float64]
_DRY_SPEED = 2.0e-3  # m/s, below it dry friction of the inner mass's guide counts as creep
_TRAVEL_M = 0.03  # beyond it the coil's reach and the spring's hardening stay what they are there
_EVENTS = 8  # stick and slip changes that one step may hold
_PERIODIC = 1.0e-8  # change of the state over a period, in m and m/s, below which the motion is periodic


class Motion(NamedTuple):
    """Path of the body x in m, its speed v, the inner mass's displacement and speed against it; `mode` 0 rests, +1, -1 slides."""

    x: float
    v: float
    stretch: float
    rate: float
    mode: int


@nb.njit(cache=True, inline="always")
def suspension_force(stretch: float, rate: float, q: VibroCycle) -> float:
    """Pull of the suspension on the inner mass towards the body in N: spring, damping, guide, stops."""
    inside = min(abs(stretch), _TRAVEL_M)
    force = (q.stiffness + q.cubic * inside * inside) * stretch + q.damping * rate
    if q.dry_N != 0.0:
        force += q.dry_N * rate / math.sqrt(rate * rate + _DRY_SPEED * _DRY_SPEED)
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
    return q.force_N * on * math.exp(q.reach_per_m * min(max(stretch, -_TRAVEL_M), _TRAVEL_M))


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
    if q.drag_power == 1.0:
        return q.drag_N * v / 0.01
    return math.copysign(q.drag_N * (abs(v) / 0.01) ** q.drag_power, v)


@nb.njit(cache=True, inline="always")
def _accelerations(mode: int, v: float, stretch: float, rate: float, on: float, q: VibroCycle) -> tuple[float, float, float]:
    """Accelerations of the body and of the inner mass against it, and the force on the body but for its Coulomb friction."""
    spring = suspension_force(stretch, rate, q)
    push = drive_force(on, stretch, q)
    on_body = spring - q.reaction * push + q.incline_N
    body = 0.0
    if mode != 0:
        body = (on_body - mode * friction(abs(v), mode, q) - resistance(v, q)) / q.body_kg
    return body, (push - spring) / q.inner_kg - body, on_body


@nb.njit(cache=True, inline="always")
def _heun(s: Motion, on0: float, on1: float, h: float, q: VibroCycle) -> tuple[Motion, float, float, float]:
    """One step of Heun's method in one mode; with it the body's acceleration at both ends and the force on it at the end."""
    a0, b0, _ = _accelerations(s.mode, s.v, s.stretch, s.rate, on0, q)
    a1, b1, _ = _accelerations(s.mode, s.v + h * a0, s.stretch + h * s.rate, s.rate + h * b0, on1, q)
    v, rate = s.v + 0.5 * h * (a0 + a1), s.rate + 0.5 * h * (b0 + b1)
    x = s.x + 0.5 * h * (s.v + v) - h * h * (a1 - a0) / 12.0
    stretch = s.stretch + 0.5 * h * (s.rate + rate) - h * h * (b1 - b0) / 12.0
    _, _, force = _accelerations(0, 0.0, stretch, rate, on1, q)
    return Motion(x, v, stretch, rate, s.mode), a0, a1, force


@nb.njit(cache=True, inline="always")
def _stop_time(v: float, a0: float, a1: float, h: float) -> float:
    """When, within h, the speed `v + a0 t + (a1 - a0) t^2/(2 h)` is zero, as a share of h."""
    bend = 0.5 * (a1 - a0) / h
    root = math.sqrt(max(a0 * a0 - 4.0 * bend * v, 0.0))
    time = h
    for low in (-a0 - root, -a0 + root):
        if low != 0.0 and 0.0 <= 2.0 * v / low < time:
            time = 2.0 * v / low
    return time / h


@nb.njit(cache=True, inline="always")
def _break_away(force: float, q: VibroCycle) -> int:
    """The direction in which a resting body starts to slide under `force`, 0 while friction holds it."""
    if force > friction(0.0, 1, q):
        return 1
    return -1 if force < -friction(0.0, -1, q) else 0


@nb.njit(cache=True)
def _step(s: Motion, on0: float, on1: float, h: float, q: VibroCycle) -> Motion:
    """One step with its changes between stick and slip located in it (second order in h)."""
    rest = 1.0
    for _ in range(_EVENTS):
        start = on0 + (on1 - on0) * (1.0 - rest)
        span = rest * h
        before = 0.0
        if s.mode == 0:
            _, _, before = _accelerations(0, 0.0, s.stretch, s.rate, start, q)
            mode = _break_away(before, q)
            if mode != 0:
                s = Motion(s.x, 0.0, s.stretch, s.rate, mode)
        new, a0, a1, force = _heun(s, start, on1, span, q)
        if s.mode == 0:
            mode = _break_away(force, q)
            if mode == 0:
                return new
            share = (mode * friction(0.0, mode, q) - before) / (force - before)
        elif new.v * s.mode < 0.0:
            mode = 0
            share = _stop_time(s.v, a0, a1, span)
        else:
            return new
        new, _, _, _ = _heun(s, start, start + (on1 - start) * share, share * span, q)
        s = Motion(new.x, 0.0, new.stretch, new.rate, mode)
        rest *= 1.0 - share
        if rest < 1e-9:
            return s
    return s


@nb.njit(cache=True)
def _phase(
    s: Motion, current: float, pull: float, on: float, length: float, step: float, q: VibroCycle
) -> tuple[Motion, float, float]:
    """The drive held at `on` for `length` s; the coil's current and the force's own lag are carried along."""
    n = max(math.ceil(length / step), 1)
    h = length / n
    fade_current = math.exp(-h / q.current_lag_s) if q.current_lag_s > 0.0 else 0.0
    fade_pull = math.exp(-h / q.force_lag_s) if q.force_lag_s > 0.0 else 0.0
    if q.current_lag_s <= 0.0 and q.force_lag_s <= 0.0:
        pull = on
    for _ in range(n):
        after = on + (current - on) * fade_current
        middle = 0.5 * (current * current + after * after)
        ends = middle + (pull - middle) * fade_pull if q.force_lag_s > 0.0 else after * after
        if q.force_lag_s <= 0.0:
            pull = current * current if q.current_lag_s > 0.0 else on
        s = _step(s, pull, ends, h, q)
        current, pull = after, ends
    return s, current, pull


@nb.njit(cache=True)
def _change(a: Motion, b: Motion) -> float:
    return max(abs(a.v - b.v), abs(a.stretch - b.stretch), abs(a.rate - b.rate))


@nb.njit(cache=True)
def mean_velocity(period_s: float, duty: float, cycles: int, settle: int, step: float, q: VibroCycle) -> float:
    """Mean speed of the body in m/s over `cycles` periods after `settle` periods from rest.

    The drive is on for `duty * period_s`, then off; steps of at most `step` s are aligned with the switching edges. Once a period
    leaves the state as it found it the remaining ones are not stepped through.
    """
    s = Motion(0.0, 0.0, 0.0, 0.0, 0)
    current, pull, begin = 0.0, 0.0, 0.0
    for cycle in range(settle + cycles):
        if cycle == settle:
            begin = s.x
        last, last_pull = s, pull
        if duty > 0.0:
            s, current, pull = _phase(s, current, pull, 1.0, duty * period_s, step, q)
        if duty < 1.0:
            s, current, pull = _phase(s, current, pull, 0.0, (1.0 - duty) * period_s, step, q)
        if _change(s, last) < _PERIODIC and abs(pull - last_pull) < _PERIODIC and s.mode == last.mode:
            advance = s.x - last.x
            if cycle < settle:
                return advance / period_s
            return (s.x - begin + advance * (settle + cycles - 1 - cycle)) / (cycles * period_s)
    return (s.x - begin) / (cycles * period_s)


@nb.njit(cache=True, nogil=True)
def table(period_s: Array, duty: Array, cycles: Array, settle: int, step: float, q: VibroCycle) -> Array:
    speeds = np.empty(period_s.size)
    for i in range(period_s.size):
        speeds[i] = mean_velocity(period_s[i], duty[i], int(cycles[i]), settle, step, q)
    return speeds
