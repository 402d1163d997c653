"""What holds a sliding or resting body: the gut or a plate, and the clip that makes friction set-valued."""

from plant.compiling import compiled
from plant.layout import GUT, P_MU, P_MU_STATIC, P_SURFACE, P_WEIGHT, S_PRESSING
from plant.tables import Floats, resistance


@compiled
def sliding_limit(v: float, hoop: float, s: Floats, p: Floats, tab: Floats) -> float:
    """`F_e(|v|)` of the gut or `mu N` of a plate in N, times the level `hoop`; a plate at `v = 0` has its static
    one.
    """
    if p[P_SURFACE] == GUT:
        return hoop * resistance(tab, v)
    return float(hoop * (p[P_MU_STATIC] if v == 0.0 else p[P_MU]) * (p[P_WEIGHT] + s[S_PRESSING]))


@compiled
def kinetic_limit(v: float, limit: float, p: Floats) -> float:
    """What resists in N once a body at speed `v` under the limit `limit` slides on: less than the limit where a plate
    lets go.
    """
    if p[P_SURFACE] != GUT and v == 0.0 and limit > 0.0:
        return float(limit * p[P_MU] / p[P_MU_STATIC])
    return limit


@compiled
def clipped_speed(v: float, force: float, limit: float, kinetic: float, mass: float, dt: float) -> float:
    """Speed after a step under `force` and a friction that may be anything within `limit` to stop the body, `kinetic`
    once it slides.

    `m (v+ - v) = (F - r) dt`, `r` in `limit Sgn(v+)`. A body at rest under less than `limit` stays at exactly zero. The
    impulse is clipped, nothing is smoothed (Moreau's time stepping).
    """
    momentum = mass * v + force * dt
    if abs(momentum) <= limit * dt:
        return 0.0
    return (momentum - kinetic * dt if momentum > 0 else momentum + kinetic * dt) / mass
