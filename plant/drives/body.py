"""One driven body: magnet on a carriage, a pair of magnets, coil, plain force, or an elastic link to an imposed
position.
"""

import math
from typing import Final

from plant import layout as at
from plant.anatomy import profile_level
from plant.compiling import compiled
from plant.hidden.actuation import (
    coupling,
    delivered,
    dipole_load,
    effective_current,
    hidden_emf,
    link_force,
    remember_drive,
    sideways_load,
)
from plant.hidden.forces import hidden_force, inertia, remember_stress
from plant.hidden.resistance import hoop_at_slip, remember_motion, resistance_at_nose, resistance_level
from plant.hidden.table import has_drive, has_force, has_level
from plant.rows import write_row
from plant.surface import clipped_speed, kinetic_limit, sliding_limit
from plant.tables import Floats
from plant.wall import move_wall, wall_force

MAGNET: Final = 0  # kinds of drive in the compiled step
COIL: Final = 1
FORCE: Final = 2
LINK: Final = 3
PAIR: Final = 4


@compiled
def coil_current(voltage: float, emf: float, dt: float, current: float, p: Floats) -> float:
    """Current in A after a step of `L i' = U - R i - e`, backward Euler, held within the limit; `L = 0` follows at
    once.
    """
    if p[at.P_COIL_L] > 0.0:
        lag = dt / p[at.P_COIL_L]
        current = (current + lag * (voltage - emf)) / (1 + lag * p[at.P_COIL_R])
    else:
        current = (voltage - emf) / p[at.P_COIL_R]
    return float(min(max(current, -p[at.P_COIL_LIMIT]), p[at.P_COIL_LIMIT]))


@compiled
def _magnet_force(gap: float, p: Floats) -> float:
    fall = 1 + (gap / p[at.P_MAGNET_RANGE]) ** 2
    return float(p[at.P_MAGNET_K] * gap / (fall * fall))


@compiled
def pair_force(gap: float, s: Floats, p: Floats) -> float:
    """Force in N along the lumen between two dipoles, `3 mu_0/(4 pi r^5) ((m1 r) m2 + (m2 r) m1 + (m1 m2) r - 5 (m1 r)
    (m2 r) r/r^2)` with r from magnet to capsule; its part across the lumen presses the body on its surface.
    """
    rx, rz = -gap, -p[at.P_MAGNET_HEIGHT]
    along = p[at.P_MAGNET_ALONG]
    ax, az = p[at.P_OUTER_MOMENT] * along, p[at.P_OUTER_MOMENT] * (1 - along)
    bx, bz = -p[at.P_INNER_MOMENT] * along, p[at.P_INNER_MOMENT] * (1 - along)
    r2 = rx * rx + rz * rz
    a, b, ab = ax * rx + az * rz, bx * rx + bz * rz, ax * bx + az * bz
    scale = 3e-7 / (r2 * r2 * math.sqrt(r2))
    rest = ab - 5 * a * b / r2
    s[at.S_PRESSING] = max(scale * (a * bz + b * az + rest * rz), 0.0)
    return float(scale * (a * bx + b * ax + rest * rx))


@compiled
def _drive_force(kind: int, value: float, rate: float, dt: float, s: Floats, p: Floats) -> float:
    """Force of a drive without hidden effects; a coil's current moves on."""
    x, v = s[at.S_X], s[at.S_V]
    if kind == MAGNET:
        return _magnet_force(value - x, p)
    if kind == PAIR:
        return pair_force(value - x, s, p)
    if kind == COIL:
        s[at.S_CURRENT] = coil_current(value, p[at.P_COIL_EMF] * v, dt, s[at.S_CURRENT], p)
        return float(p[at.P_COIL_GAIN] * s[at.S_CURRENT])
    if kind == LINK:
        return float(p[at.P_LINK_K] * (value - x) + p[at.P_LINK_C] * (rate - v))
    return float(value)


@compiled
def _hidden_drive_force(
    kind: int, value: float, rate: float, t: float, dt: float, s: Floats, p: Floats, h: Floats
) -> float:
    """The same with what is hidden between drive and body."""
    x, v = s[at.S_X], s[at.S_V]
    if kind in (MAGNET, PAIR):
        remember_drive(value - x, s, h)
        if kind == MAGNET:
            pulled = _magnet_force(value - x, p)
            s[at.S_PRESSING] = dipole_load(value - x, h)
        else:
            pulled = pair_force(value - x, s, p)
        return delivered(coupling(x, t, h) * pulled, s, h)
    if kind == COIL:
        s[at.S_CURRENT] = coil_current(value, p[at.P_COIL_EMF] * v + hidden_emf(v, h), dt, s[at.S_CURRENT], p)
        remember_drive(s[at.S_CURRENT], s, h)
        return delivered(coupling(x, t, h) * p[at.P_COIL_GAIN] * effective_current(s[at.S_CURRENT], h), s, h)
    if kind == LINK:
        return link_force(value - x, p[at.P_LINK_K], h) + float(p[at.P_LINK_C] * (rate - v))
    return float(value)


@compiled
def advance_body(
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
    """Drive one body with `drive[0], drive[1], ...`, one value a step of `dt`; fill `out` with a row each `every`
    steps.

    `m a = F_act - R Sgn(v) - F_v(w) - T(u) + F_hidden`, R set-valued: the impulse that would stop the body is clipped
    to what R can give. `drive` is a carriage position in m (MAGNET: `k g/(1 + (g/r)^2)^2`; PAIR: two dipoles), a
    voltage in V (COIL: `F = K i`, `L i' = U - R i - e`), a force in N (FORCE) or an imposed position in m (LINK), one
    more value than steps done. State `s` is changed in place; returns the rows written. First order in `dt`. Steps that
    cannot change anything (a resting body under the same drive as before) are passed over.
    """
    rows = 0
    step = int(s[at.S_STEP])
    due = -step % every
    mass = inertia(p, h)
    leveled, forced = has_level(h), has_force(h)
    steered = has_drive(h)
    unchanging = not (leveled or forced or steered) and kind != COIL
    held = False
    for k in range(drive.shape[0] - 1):
        if held and k != due and drive[k] == drive[k - 1] and drive[k + 1] == drive[k]:
            continue
        t = (step + k) * dt
        x, v = s[at.S_X], s[at.S_V]
        rate = (drive[k + 1] - drive[k]) / dt
        if steered:
            force = _hidden_drive_force(kind, drive[k], rate, t, dt, s, p, h)
        else:
            force = _drive_force(kind, drive[k], rate, dt, s, p)
        if k == due:
            write_row(out[rows], t, s, force, drive[k])
            rows += 1
            due += every
        hoop = p[at.P_HOOP] * profile_level(x, p, profile)
        if leveled:
            hoop *= resistance_level(x, v, t, s, h)
        limit = sliding_limit(v, hoop, s, p, tab)
        if leveled:
            limit = resistance_at_nose(limit, v, h)
            hoop = hoop_at_slip(hoop, x, h)
        net = force - wall_force(v, hoop, s, p, h, tab)
        if kind in (MAGNET, PAIR):
            limit += sideways_load(drive[k] - x, h)
        if forced:
            net += hidden_force(x, v, t, s, p, h)
        resting = v == 0.0
        v = clipped_speed(v, net, limit, kinetic_limit(v, limit, p), mass, dt)
        if v != 0.0:
            s[at.S_DIRECTION] = 1.0 if v > 0 else -1.0
        s[at.S_V] = v
        s[at.S_X] = x + dt * v
        move_wall(v, dt, hoop, s, p, h, tab)
        held = unchanging and resting and v == 0.0 and s[at.S_SLIP] == 0.0
        if leveled:
            remember_motion(v, dt, s, h)
        if forced:
            remember_stress(v, dt, s, h)
    s[at.S_STEP] += drive.shape[0] - 1
    return rows
