"""A body with an inner mass on a spring between two stops (vibro-impact drive, capsubot)."""

from typing import Final

from plant import layout as at
from plant.anatomy import profile_level
from plant.compiling import compiled
from plant.drives.body import coil_current
from plant.hidden.forces import field_reach, hidden_force, inertia, remember_stress, suspension_force
from plant.hidden.resistance import remember_motion, resistance_level
from plant.hidden.table import has_force, has_level
from plant.rows import write_row
from plant.surface import clipped_speed, kinetic_limit, sliding_limit
from plant.tables import Floats
from plant.wall import move_wall, wall_force

BY_FORCE: Final = 0  # what the inner mass is driven by
BY_VOLTAGE: Final = 1


@compiled
def spring_force(r: float, rate: float, p: Floats) -> float:
    """`F_i = k r + c r' + k_f (r - G_f)+ - k_r (-r - G_r)+` in N on the inner mass's offset `r` in m from rest."""
    force = p[at.P_SPRING_K] * r + p[at.P_SPRING_C] * rate
    if r > p[at.P_FRONT_GAP]:
        force += p[at.P_FRONT_K] * (r - p[at.P_FRONT_GAP])
    if -r > p[at.P_REAR_GAP]:
        force += p[at.P_REAR_K] * (r + p[at.P_REAR_GAP])
    return float(force)


@compiled
def advance_vibro(
    kind: int,
    s: Floats,
    p: Floats,
    h: Floats,
    tab: Floats,
    profile: Floats,
    drive: Floats,
    dt: float,
    every: int,
    out: Floats,
) -> int:
    """Drive the inner mass with `drive[k]`, the mean force in N (BY_FORCE) or voltage in V (BY_VOLTAGE) of step `k` of
    `dt`.

    `M_m X_m'' = -F_i + F`, `M X'' = F_i - a F - R Sgn(X') - F_v - T + F_hidden`; a = 1 with the reaction on the body, 0
    for a field from outside. Forces at the positions of mid-step (second order while nothing sticks or hits), R
    set-valued by clipping. A step's mean force keeps the impulse of a PWM edge inside a step exact. `drive` holds one
    more value than steps done. Returns the rows written.
    """
    rows = 0
    step = int(s[at.S_STEP])
    due = -step % every
    mass = inertia(p, h)
    leveled, forced = has_level(h), has_force(h)
    for k in range(drive.shape[0] - 1):
        t = (step + k) * dt
        x, v = s[at.S_X], s[at.S_V]
        inner_x, inner_v = s[at.S_INNER_X], s[at.S_INNER_V]
        force = drive[k]
        if kind == BY_VOLTAGE:
            s[at.S_CURRENT] = coil_current(drive[k], p[at.P_COIL_EMF] * (inner_v - v), dt, s[at.S_CURRENT], p)
            force = p[at.P_COIL_GAIN] * s[at.S_CURRENT]
        if k == due:
            write_row(out[rows], t, s, force, drive[k])
            rows += 1
            due += every
        rate = inner_v - v
        offset = inner_x - x + 0.5 * dt * rate
        force *= field_reach(offset, h)
        spring = spring_force(offset, rate, p)
        spring += suspension_force(offset, rate, h)
        hoop = p[at.P_HOOP] * profile_level(x, p, profile)
        if leveled:
            hoop *= resistance_level(x, v, t, s, h)
        limit = sliding_limit(v, hoop, s, p, tab)
        net = spring - p[at.P_REACTION] * force - wall_force(v, hoop, s, p, h, tab)
        if forced:
            net += hidden_force(x, v, t, s, p, h)
        v_next = clipped_speed(v, net, limit, kinetic_limit(v, limit, p), mass, dt)
        inner_next = inner_v + dt * (force - spring) / p[at.P_INNER_MASS]
        mean = 0.5 * (v + v_next)
        if v_next != 0.0:
            s[at.S_DIRECTION] = 1.0 if v_next > 0 else -1.0
        s[at.S_V] = v_next
        s[at.S_X] = x + dt * mean
        s[at.S_INNER_V] = inner_next
        s[at.S_INNER_X] = inner_x + 0.5 * dt * (inner_v + inner_next)
        move_wall(mean, dt, hoop, s, p, h, tab)
        if leveled:
            remember_motion(mean, dt, s, h)
        if forced:
            remember_stress(mean, dt, s, h)
    s[at.S_STEP] += drive.shape[0] - 1
    return rows
