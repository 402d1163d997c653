"""An imposed capsule position and the force that it takes (stiff pull)."""

from plant import layout as at
from plant.anatomy import profile_level
from plant.compiling import compiled
from plant.hidden.forces import hidden_force, inertia, remember_stress
from plant.hidden.resistance import hoop_at_slip, remember_motion, resistance_at_nose, resistance_level
from plant.hidden.table import has_force, has_level
from plant.surface import sliding_limit
from plant.tables import Floats
from plant.wall import move_wall, wall_force


@compiled
def advance_pull(
    s: Floats, p: Floats, h: Floats, tab: Floats, profile: Floats, drive: Floats, dt: float, every: int, out: Floats
) -> int:
    """Impose positions `drive[0], drive[1], ...` in m at steps of `dt` from now on; fill `out` with a row each `every`
    steps.

    `F = m a + R(|v|) Sgn(v) + F_v(w) + T(u) - F_hidden`; at rest the last direction's R is kept. `drive` holds one more
    value than steps done. A row has the rate of `x` at which the capsule came to where it is. State `s` is changed in
    place; returns the rows written.
    """
    rows = 0
    leveled, forced = has_level(h), has_force(h)
    step = int(s[at.S_STEP])
    due = -step % every
    for k in range(drive.shape[0] - 1):
        x, t = drive[k], (step + k) * dt
        v = (drive[k + 1] - x) / dt
        if abs(v) < 1e-12:
            v = 0.0
        hoop = p[at.P_HOOP] * profile_level(x, p, profile)
        if k == due:
            came = s[at.S_V]
            seen = hoop * resistance_level(x, came, t, s, h) if leveled else hoop
            force = inertia(p, h) * (v - came) / dt
            limit = sliding_limit(came, seen, s, p, tab)
            if leveled:
                limit = resistance_at_nose(limit, came, h)
                seen = hoop_at_slip(seen, x, h)
            force += s[at.S_DIRECTION] * limit + wall_force(came, seen, s, p, h, tab)
            out[rows, at.O_T] = t
            out[rows, at.O_X] = x
            out[rows, at.O_V] = came
            out[rows, at.O_U] = s[at.S_U]
            out[rows, at.O_FORCE] = force - (hidden_force(x, came, t, s, p, h) if forced else 0.0)
            out[rows, at.O_DRIVE] = x
            rows += 1
            due += every
        if v != 0.0:
            s[at.S_DIRECTION] = 1.0 if v > 0 else -1.0
        if leveled:
            hoop = hoop_at_slip(hoop * resistance_level(x, v, t, s, h), x, h)
        s[at.S_V] = v
        s[at.S_X] = drive[k + 1]
        move_wall(v, dt, hoop, s, p, h, tab)
        if leveled:
            remember_motion(v, dt, s, h)
        if forced:
            remember_stress(v, dt, s, h)
    s[at.S_STEP] += drive.shape[0] - 1
    return rows
