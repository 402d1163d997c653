"""Body and inner mass on a plate under a periodic on/off drive: mean velocity with exact stick and slip, compiled."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from models.drives.vibro_forces import VibroCycle, drive_force, friction, resistance, suspension_force

Array = NDArray[np.float64]
STEP_S = 2.0e-4
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
def _table(period_s: Array, duty: Array, cycles: Array, settle: int, step: float, q: VibroCycle) -> Array:
    speeds = np.empty(period_s.size)
    for i in range(period_s.size):
        speeds[i] = mean_velocity(period_s[i], duty[i], int(cycles[i]), settle, step, q)
    return speeds


def mean_velocities(period_s: Any, duty: Any, cycles: Any, q: VibroCycle, settle: int = 0, step: float = STEP_S) -> Array:
    """Mean speeds in m/s, one a condition, of a body started from rest; arrays of one length n, SI.

    `M v' = S(xi, xi') - r F + incline - Coulomb - drag`, `m (v' + xi'') = F - S`, with the suspension's force S, the coil's F and
    r = 1 where the coil sits on the body; Coulomb friction is set-valued (the body rests while the other forces stay within it).
    Structure as in Liu, Pavlovskaia and Wiercigroch. Raises ValueError for periods not above 0, duties outside [0, 1] or cycles
    below 1.
    """
    period, share, count = np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in (period_s, duty, cycles)))
    if not np.all(period > 0):
        raise ValueError(f"period_s must be above 0; got {float(np.min(period)):g}")
    if not np.all((share >= 0) & (share <= 1)):
        raise ValueError(f"duty must lie in [0, 1]; got {float(share[(share < 0) | (share > 1)][0]):g}")
    if not np.all(count >= 1):
        raise ValueError(f"cycles must be at least 1; got {float(np.min(count)):g}")
    p, d, c = (np.ascontiguousarray(a, dtype=float).ravel() for a in (period, share, count))
    speeds: Array = _table(p, d, c, settle, step, q)
    return speeds.reshape(period.shape)
