"""The resistance to the body over one step: set-valued friction of gut or plate, the wall's stick and slip."""

import math
from typing import Final

from plant.compiling import compiled
from plant.hidden.registry import ROW
from plant.layout import GUT, P_MU, P_MU_STATIC, P_RECOVERY, P_SURFACE, P_VISCOUS, P_WEIGHT, S_PRESSING, S_SLIP, S_U
from plant.tables import Floats, drag_at, film_drag, pressure_load, resistance, tension

_MOST: Final = 200  # iterations for the stretch of a stiffened wall
_SETTLED_M: Final = 1e-9  # change of the stretch that ends them


@compiled
def stiffening(u: float, h: Floats) -> float:
    """Factor on T(u): `1 + a/(1 + (|u|/u_0)^1.2)`."""
    if h[ROW.small_strain_stiffening, 0] == 0.0:
        return 1.0
    return float(1 + h[ROW.small_strain_stiffening, 0] / (1 + (abs(u) / h[ROW.small_strain_stiffening, 1]) ** 1.2))


@compiled
def rate_tension(rate: float, h: Floats) -> float:
    """Tension in N that the stretch rate `u'` in m/s adds: `a sgn(u') (|u'|/10 mm/s)^0.9`."""
    if h[ROW.wall_viscosity, 0] == 0.0 or rate == 0.0:
        return 0.0
    return float(math.copysign(h[ROW.wall_viscosity, 0] * (abs(rate) * 100.0) ** 0.9, rate))


@compiled
def recovery_speed(u: float, u_c: float, t_r: float, h: Floats) -> float:
    """Recovery speed in m/s of a slipping wall: `u_c/t_r`, or the hidden exponential one."""
    if h[ROW.exponential_recovery, 0] == 0.0:
        return u_c / t_r
    return float(h[ROW.exponential_recovery, 0] * u_c * (0.15 + (abs(u) / u_c) ** 0.8) / t_r)


@compiled
def sliding_limit(v: float, hoop: float, s: Floats, p: Floats, tab: Floats) -> float:
    """`hoop F_e(|v|)` of the gut or `hoop (mu N + F_v |v|)` of a plate in N; the static one of a plate at `v = 0`."""
    if p[P_SURFACE] == GUT:
        return hoop * resistance(tab, v)
    coulomb = (p[P_MU_STATIC] if v == 0.0 else p[P_MU]) * (p[P_WEIGHT] + s[S_PRESSING])
    return float(hoop * (coulomb + p[P_VISCOUS] * abs(v)))


@compiled
def kinetic_limit(v: float, limit: float, p: Floats) -> float:
    """Resistance in N once a body at `v` under `limit` slides: lower on a plate after break-away."""
    if p[P_SURFACE] != GUT and v == 0.0 and limit > 0.0:
        return float(limit * p[P_MU] / p[P_MU_STATIC])
    return limit


@compiled
def clipped_speed(v: float, force: float, limit: float, kinetic: float, mass: float, dt: float) -> float:
    """Speed after a step: `m (v+ - v) = (F - r) dt`, `r` in `limit Sgn(v+)`, `kinetic` once it slides. A body at rest
    under less than `limit` stays at exactly zero: the impulse is clipped, nothing is smoothed (Moreau's time stepping).
    """
    momentum = mass * v + force * dt
    if abs(momentum) <= limit * dt:
        return 0.0
    return (momentum - kinetic * dt if momentum > 0 else momentum + kinetic * dt) / mass


@compiled
def wall_limit(v: float, hoop: float, s: Floats, p: Floats, tab: Floats) -> float:
    """`f_c = mu N(|v|)` in N, the pressure part of N scaled by the hoop factor `hoop`."""
    return float(p[P_MU] * (p[P_WEIGHT] + s[S_PRESSING] + hoop * pressure_load(tab, v)))


@compiled
def draw_back_speed(v: float, hoop: float, s: Floats, p: Floats, h: Floats, tab: Floats) -> float:
    """`v_i = u_c/t_r` in m/s with `T(u_c) = f_c(|v|)` at this moment."""
    limit = wall_limit(v, hoop, s, p, tab)
    u_c = drag_at(tab, limit)
    if stiffening(u_c, h) != 1.0:
        for _ in range(_MOST):
            before, u_c = u_c, drag_at(tab, limit / stiffening(u_c, h))
            if abs(u_c - before) < _SETTLED_M:
                break
    return recovery_speed(s[S_U], u_c, p[P_RECOVERY], h)


@compiled
def wall_force(v: float, hoop: float, s: Floats, p: Floats, h: Floats, tab: Floats) -> float:
    """`T(u) + F_v(w)` in N, `w = v - u'`, zero while the wall sticks; 0 on a plate."""
    if p[P_SURFACE] != GUT:
        return 0.0
    u, slip = s[S_U], s[S_SLIP]
    if slip == 0.0:
        return tension(tab, u) * stiffening(u, h) + rate_tension(v, h)
    rate = -slip * draw_back_speed(v, hoop, s, p, h, tab)
    return tension(tab, u) * stiffening(u, h) + rate_tension(rate, h) + film_drag(tab, v - rate)


@compiled
def move_wall(v: float, dt: float, hoop: float, s: Floats, p: Floats, h: Floats, tab: Floats) -> None:
    """Advance `u` by one step at the capsule's speed `v`, from stick to slip or back inside it. The wall slips if
    `|T(u)| >= f_c` and the capsule does not push it back faster than it recovers, `s v > -v_i`. The tension is linear
    within the step, and the rest of the step is spent in the other mode, so that the period of the saw-tooth does not
    grow with the step.
    """
    if p[P_SURFACE] != GUT:
        return
    slip, u = s[S_SLIP], s[S_U]
    if slip == 0.0:
        before = abs(tension(tab, u) * stiffening(u, h))
        u += dt * v
        pull = tension(tab, u) * stiffening(u, h)
        limit = wall_limit(v, hoop, s, p, tab)
        side = 1.0 if pull > 0 else -1.0
        if abs(pull) >= limit and side * v > -draw_back_speed(v, hoop, s, p, h, tab):
            s[S_SLIP] = side
            rest = dt * min(1.0, (abs(pull) - limit) / max(abs(pull) - before, 1e-15))
            s[S_U] = u - rest * v
            u = s[S_U] - side * draw_back_speed(v, hoop, s, p, h, tab) * rest
    else:
        back = draw_back_speed(v, hoop, s, p, h, tab)
        u -= slip * back * dt
        if slip * u <= 0.0:
            u = v * min(dt, abs(u) / max(back, 1e-15))
            s[S_SLIP] = 0.0
        elif slip * v <= -back:
            u = s[S_U] + dt * v
            s[S_SLIP] = 0.0
    s[S_U] = u
