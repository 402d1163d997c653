"""Body and inner mass on a plate under a periodic on/off drive, compiled: forces, exact stick and slip, mean velocity.

All of it is one file: compiled code is found again by the file's hash.
"""

import hashlib
import math
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, TypeVar, cast

import numba as nb
import numpy as np
from numpy.typing import NDArray

from models.effects.inner_mass import AT_M, TRAVEL_M

Array = NDArray[np.float64]
F = TypeVar("F")
GRAVITY: Final = 9.81  # m/s2
STEP_S = 2.0e-3  # longest step of a run's integration; the solver goes finer by itself
_DRY_SPEED = 2.0e-3  # m/s, below it dry friction of the inner mass's guide counts as creep
_SHORTEST_LAG_S = 1.0e-3  # of a lag shorter than this only the mean over a step is right
_FASTEST = 0.2  # m/s that a body may gain in one step
_EVENTS = 8  # stick and slip changes that one step may hold; the rest of it is a rest
_HASH: Final = nb.__version__ + hashlib.sha256(Path(__file__).read_bytes()).hexdigest()
_PERIODIC = 1.0e-6  # change of the state over a period, in m and m/s, below which the motion is periodic


def _compiled(function: F, inline: Literal["never", "always"] = "never") -> F:
    """Compiled on first use and kept; numba reads the classes of an older file's index before it compares dates."""
    dispatcher: Any = nb.njit(cache=True, nogil=True, inline=inline)(function)
    dispatcher._cache._cache_file._version = _HASH
    return cast(F, dispatcher)


def _inlined(function: F) -> F:
    return _compiled(function, "always")


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
    cubic_power: float = 3.0
    stop_stiffness: float = 0.0
    stop_gap_m: float = 1.0
    stop_loss_s: float = 0.0
    current_lag_s: float = 0.0
    force_lag_s: float = 0.0
    reach_per_m: float = 0.0
    asymmetry: float = 0.0
    incline_N: float = 0.0
    drag_N: float = 0.0
    drag_power: float = 1.0
    stribeck: float = 0.0
    stribeck_speed: float = 0.003
    stribeck_power: float = 2.0


class BodyState(NamedTuple):
    """Path x in m and speed v of the body, position and speed of the inner mass on it; `mode` 0 rests, +1, -1 slide."""

    x: float
    v: float
    stretch: float
    rate: float
    mode: int


class PulseShare(NamedTuple):
    """The drive's share of its full force over one step of `h` s: at its begin, its mean, at its end."""

    begin: float
    mean: float
    end: float
    h: float


@_inlined
def suspension_force(stretch: float, rate: float, q: VibroCycle) -> float:
    """Pull of the suspension on the inner mass towards the body in N: spring, damping, guide, stops."""
    inside = min(abs(stretch), TRAVEL_M)
    hardening = q.cubic * inside * inside
    if q.cubic_power != 3.0:
        hardening = q.cubic * AT_M**2 * (inside / AT_M) ** (q.cubic_power - 1.0)
    force = (q.stiffness + hardening) * stretch + q.damping * rate
    if q.dry_N != 0.0:
        force += q.dry_N * rate / math.sqrt(rate * rate + _DRY_SPEED * _DRY_SPEED)
    if stretch > q.stop_gap_m:
        force += q.stop_stiffness * max(stretch - q.stop_gap_m + q.stop_loss_s * rate, 0.0)
    elif stretch < -q.stop_gap_m:
        force += q.stop_stiffness * min(stretch + q.stop_gap_m + q.stop_loss_s * rate, 0.0)
    return force


@_inlined
def drive_force(on: float, stretch: float, q: VibroCycle) -> float:
    """The coil's force on the inner mass in N; `on` is its share of the full one."""
    if q.reach_per_m == 0.0:
        return q.force_N * on
    return q.force_N * on * math.exp(q.reach_per_m * min(max(stretch, -TRAVEL_M), TRAVEL_M))


@_inlined
def friction(speed: float, direction: int, q: VibroCycle) -> float:
    """Coulomb friction in N of a body that moves, or would move, in `direction` (+1, -1) at `speed` >= 0."""
    level = 1.0 + q.asymmetry * direction
    if q.stribeck != 0.0:
        level *= 1.0 + q.stribeck * math.exp(-((speed / q.stribeck_speed) ** q.stribeck_power))
    return q.coulomb_N * max(level, 0.0)


@_inlined
def resistance(v: float, q: VibroCycle) -> float:
    """Resistance in N that grows with the body's speed, along -v."""
    if q.drag_N == 0.0:
        return 0.0
    if q.drag_power == 1.0:
        return q.drag_N * v / 0.01
    return q.drag_N * math.copysign((abs(v) / 0.01) ** q.drag_power, v)


@_inlined
def _accelerations(mode: int, v: float, stretch: float, rate: float, on: float, q: VibroCycle) -> tuple[float, float]:
    """Accelerations of the body and of the inner mass against it."""
    spring = suspension_force(stretch, rate, q)
    push = drive_force(on, stretch, q)
    body = 0.0
    if mode != 0:
        on_body = spring - q.reaction * push + q.incline_N
        body = (on_body - mode * friction(abs(v), mode, q) - resistance(v, q)) / q.body_kg
    return body, (push - spring) / q.inner_kg - body


@_inlined
def _on_body(s: BodyState, on: float, q: VibroCycle) -> float:
    """Force in N on a resting body, against its Coulomb friction."""
    return suspension_force(s.stretch, s.rate, q) - q.reaction * drive_force(on, s.stretch, q) + q.incline_N


@_compiled
def _runge_kutta(s: BodyState, on: PulseShare, begin: float, end: float, q: VibroCycle) -> tuple[BodyState, float]:
    """The step's share from `begin` to `end` in one mode, fourth order, and the body's acceleration at its begin."""
    k = (end - begin) * on.h
    on0, on1, on2 = _push(on, begin), _push(on, 0.5 * (begin + end)), _push(on, end)
    a0, b0 = _accelerations(s.mode, s.v, s.stretch, s.rate, on0, q)
    v, w = s.v + 0.5 * k * a0, s.rate + 0.5 * k * b0
    a1, b1 = _accelerations(s.mode, v, s.stretch + 0.5 * k * s.rate, w, on1, q)
    v, w1 = s.v + 0.5 * k * a1, s.rate + 0.5 * k * b1
    a2, b2 = _accelerations(s.mode, v, s.stretch + 0.5 * k * w, w1, on1, q)
    v, w = s.v + k * a2, s.rate + k * b2
    a3, b3 = _accelerations(s.mode, v, s.stretch + k * w1, w, on2, q)
    x = s.x + k * s.v + k * k / 6.0 * (a0 + a1 + a2)
    stretch = s.stretch + k * s.rate + k * k / 6.0 * (b0 + b1 + b2)
    v, w = s.v + k / 6.0 * (a0 + 2.0 * (a1 + a2) + a3), s.rate + k / 6.0 * (b0 + 2.0 * (b1 + b2) + b3)
    return BodyState(x, v, stretch, w, s.mode), a0


@_inlined
def _push(on: PulseShare, at: float) -> float:
    """The drive's share at the share `at` of a step: the parabola with the right ends and the right mean."""
    bend = 3.0 * (on.begin + on.end - 2.0 * on.mean)
    return on.begin + at * (on.end - on.begin - bend * (1.0 - at))


@_inlined
def _break_away(force: float, q: VibroCycle) -> int:
    """The direction in which a resting body starts to slide under `force`, 0 while friction holds it."""
    if force > friction(0.0, 1, q):
        return 1
    return -1 if force < -friction(0.0, -1, q) else 0


@_compiled
def _stop(
    s: BodyState, new: BodyState, a0: float, on: PulseShare, begin: float, until: float, q: VibroCycle
) -> tuple[BodyState, float]:
    """State and time in the step at which a sliding body comes to rest: a parabola, then one step of Newton."""
    k = (until - begin) * on.h
    bend = new.v - s.v - a0 * k
    root = math.sqrt(max(a0 * a0 * k * k - 4.0 * bend * s.v, 0.0))
    at = 1.0
    for low in (-a0 * k - root, -a0 * k + root):
        if low != 0.0 and 0.0 < 2.0 * s.v / low < at:
            at = 2.0 * s.v / low
    if s.v == 0.0:
        at = min(max(-a0 * k / bend, 0.0), 1.0) if bend != 0.0 else 0.0
    end = begin + at * (until - begin)
    new, _ = _runge_kutta(s, on, begin, end, q)
    slope, _ = _accelerations(s.mode, new.v, new.stretch, new.rate, _push(on, end), q)
    if slope * s.mode < 0.0:
        end = min(max(end - new.v / (slope * on.h), begin), until)
        new, _ = _runge_kutta(s, on, begin, end, q)
    return BodyState(new.x, 0.0, new.stretch, new.rate, 0), end


@_compiled
def _start(
    s: BodyState, mode: int, before: float, after: float, on: PulseShare, begin: float, until: float, q: VibroCycle
) -> tuple[BodyState, float]:
    """State and time in the step at which a resting body starts to slide as `mode`: two steps of regula falsi."""
    limit = mode * friction(0.0, mode, q)
    low, high, below, above = begin, until, before - limit, after - limit
    new = s
    for _ in range(2):
        end = low + (high - low) * below / (below - above) if above != below else low
        new, _ = _runge_kutta(s, on, begin, end, q)
        force = _on_body(new, _push(on, end), q) - limit
        if force * mode > 0.0:
            high, above = end, force
        else:
            low, below = end, force
    return BodyState(new.x, 0.0, new.stretch, new.rate, mode), end


@_compiled
def _share(s: BodyState, on: PulseShare, begin: float, until: float, q: VibroCycle) -> BodyState:
    """The step's share from `begin` to `until` with its changes between stick and slip located in it."""
    for _ in range(_EVENTS):
        before = 0.0
        if s.mode == 0:
            before = _on_body(s, _push(on, begin), q)
            s = BodyState(s.x, 0.0, s.stretch, s.rate, _break_away(before, q))
        new, a0 = _runge_kutta(s, on, begin, until, q)
        if s.mode != 0:
            if new.v * s.mode >= 0.0:
                return new
            s, begin = _stop(s, new, a0, on, begin, until, q)
        else:
            after = _on_body(new, _push(on, until), q)
            mode = _break_away(after, q)
            if mode == 0:
                return new
            s, begin = _start(s, mode, before, after, on, begin, until, q)
        if begin > until - 1e-9:
            return s
    new, _ = _runge_kutta(BodyState(s.x, 0.0, s.stretch, s.rate, 0), on, begin, until, q)
    return new


@_compiled
def _step(s: BodyState, on: PulseShare, q: VibroCycle) -> BodyState:
    """One step, in equal parts where dry friction reverses or a stop is near."""
    h = on.h
    fine = h
    if q.drag_N > 0.0 and s.mode != 0:
        gain, _ = _accelerations(s.mode, s.v, s.stretch, s.rate, on.mean, q)
        fastest = (abs(s.v) + min(abs(gain) * h, _FASTEST)) / 0.01
        fine = 0.01 * q.body_kg / (q.drag_N * max(q.drag_power * fastest ** (q.drag_power - 1.0), 1.0))
    if q.dry_N > 0.0 or q.stop_stiffness > 0.0:
        mass = q.body_kg * q.inner_kg / (q.body_kg + q.inner_kg)
        _, gain = _accelerations(s.mode, s.v, s.stretch, s.rate, on.mean, q)
        if q.dry_N > 0.0 and abs(s.rate) < abs(gain) * h + 3.0 * _DRY_SPEED:
            fine = min(fine, 1.5 * _DRY_SPEED * mass / q.dry_N)
        if q.stop_stiffness > 0.0 and abs(s.stretch) + (abs(s.rate) + abs(gain) * h) * h > q.stop_gap_m:
            fine = min(fine, 0.2 * math.sqrt(mass / q.stop_stiffness))
    parts = max(math.ceil(min(h / fine, 200.0)), 1)
    for i in range(parts):
        s = _share(s, on, i / parts, (i + 1) / parts, q)
    return s


@_compiled
def _phase(
    s: BodyState, current: float, pull: float, on: float, length: float, step: float, q: VibroCycle
) -> tuple[BodyState, float, float]:
    """The drive held at `on` for `length` s: the coil's current follows it, the current's square makes the force, which
    may lag too.

    All of it is `on + sum of A_j exp(-t/tau_j)`, with the current's time constant, half of it, and the force's own.
    """
    n = max(math.ceil(length / step), 1)
    h = length / n
    slow, lag = q.current_lag_s, q.force_lag_s
    if abs(lag - slow) < 1e-3 * slow or abs(2.0 * lag - slow) < 1e-3 * slow:
        lag *= 1.003
    a1, a2 = (2.0 * on * (current - on), (current - on) ** 2) if slow > 0.0 else (0.0, 0.0)
    a3 = 0.0
    if lag > 0.0:
        a1, a2 = (a1 / (1.0 - lag / slow), a2 / (1.0 - 2.0 * lag / slow)) if slow > 0.0 else (0.0, 0.0)
        a3 = pull - on - a1 - a2
    f1 = math.exp(-h / slow) if slow > 0.0 else 0.0
    f2, f3 = f1 * f1, math.exp(-h / lag) if lag > 0.0 else 0.0
    m1, m2, m3 = slow / h * (1.0 - f1), 0.5 * slow / h * (1.0 - f2), lag / h * (1.0 - f3)
    for _ in range(n):
        begin, mean = on + a1 + a2 + a3, on + a1 * m1 + a2 * m2 + a3 * m3
        a1, a2, a3 = a1 * f1, a2 * f2, a3 * f3
        s = _step(s, PulseShare(begin, mean, on + a1 + a2 + a3, h), q)
    return s, on + (current - on) * f1**n, on + a1 + a2 + a3


@_compiled
def mean_velocity(period_s: float, duty: float, cycles: int, step: float, q: VibroCycle) -> float:
    """Mean speed of the body in m/s over `cycles` periods from rest.

    The drive is on for `duty * period_s`, then off; steps of at most `step` s are aligned with the switching edges.
    Once a period leaves the state as it found it the remaining ones are not stepped through.
    """
    s = BodyState(0.0, 0.0, 0.0, 0.0, 0)
    current, pull = 0.0, 0.0
    for lag in (q.current_lag_s, q.force_lag_s):
        if lag > 0.0:
            step = min(step, max(lag, _SHORTEST_LAG_S))
    for cycle in range(cycles):
        last, last_pull = s, pull
        if duty > 0.0:
            s, current, pull = _phase(s, current, pull, 1.0, duty * period_s, step, q)
        if duty < 1.0:
            s, current, pull = _phase(s, current, pull, 0.0, (1.0 - duty) * period_s, step, q)
        change = max(abs(s.v - last.v), abs(s.stretch - last.stretch), abs(s.rate - last.rate), abs(pull - last_pull))
        if change < _PERIODIC and s.mode == last.mode:
            return (s.x + (s.x - last.x) * (cycles - 1 - cycle)) / (cycles * period_s)
    return s.x / (cycles * period_s)


@_compiled
def table(period_s: Array, duty: Array, cycles: Array, step: float, q: VibroCycle) -> Array:
    """Mean speeds in m/s (n,) at periods in s, duties and numbers of cycles (n,)."""
    speeds = np.empty(period_s.size)
    for i in range(period_s.size):
        speeds[i] = mean_velocity(period_s[i], duty[i], int(cycles[i]), step, q)
    return speeds


def mean_velocities(period_s: Any, duty: Any, cycles: Any, q: VibroCycle, step: float = STEP_S) -> Array:
    """Mean speeds in m/s, one a condition, of a body started from rest; arrays of one length n, SI.

    `M v' = S(xi, xi') - r F + incline - Coulomb - drag`, `m (v' + xi'') = F - S`, with the suspension's force S, the
    coil's F and r = 1 where the coil sits on the body; Coulomb friction is set-valued (the body rests while the other
    forces stay within it). Structure as in Liu, Pavlovskaia and Wiercigroch. Raises ValueError for periods not above 0,
    duties outside [0, 1] or cycles below 1.
    """
    period, share, count = np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in (period_s, duty, cycles)))
    for good, values, rule in (
        (period > 0, period, "period_s must be above 0"),
        ((share >= 0) & (share <= 1), share, "duty must lie in [0, 1]"),
        (count >= 1, count, "cycles must be at least 1"),
    ):
        if not good.all():
            raise ValueError(f"{rule}; got {values[~good][0]:g}")
    p, d, c = (np.ascontiguousarray(a, dtype=float).ravel() for a in (period, share, count))
    speeds: Array = table(p, d, c, step, q)
    return speeds.reshape(period.shape)
