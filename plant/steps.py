"""The compiled steps of every simulated drive: an imposed position, a driven body, a body with an inner mass."""

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
from plant.hidden.body import (
    field_reach,
    hidden_force,
    hoop_at_slip,
    inertia,
    remember_motion,
    remember_stress,
    resistance_at_nose,
    resistance_level,
    suspension_force,
)
from plant.hidden.table import has_drive, has_force, has_level
from plant.tables import Floats
from plant.wall import clipped_speed, kinetic_limit, move_wall, sliding_limit, wall_force

PULL, MAGNET, PAIR, FORCE, LINK, COIL, INNER_FORCE, INNER_VOLTAGE = range(8)
"""Kinds of drive: position in m (PULL stiff, LINK elastic), carriage in m (MAGNET, PAIR of dipoles), N, V; the last two
drive an inner mass by the mean force or voltage of a step.
"""
_LEAST_M_S: Final = 1e-12  # imposed speed below which a pull rests


@compiled
def _write_row(row: Floats, t: float, s: Floats, force: float, drive: float) -> None:
    row[at.O_T], row[at.O_X], row[at.O_V], row[at.O_U] = t, s[at.S_X], s[at.S_V], s[at.S_U]
    row[at.O_FORCE], row[at.O_DRIVE], row[at.O_CURRENT] = force, drive, s[at.S_CURRENT]
    row[at.O_INNER_X], row[at.O_INNER_V] = s[at.S_INNER_X], s[at.S_INNER_V]


@compiled
def _coil_current(voltage: float, emf: float, dt: float, current: float, p: Floats) -> float:
    """A after a step of `L i' = U - R i - e`, backward Euler, limited; `L = 0` follows at once."""
    if p[at.P_COIL_L] > 0.0:
        lag = dt / p[at.P_COIL_L]
        current = (current + lag * (voltage - emf)) / (1 + lag * p[at.P_COIL_R])
    else:
        current = (voltage - emf) / p[at.P_COIL_R]
    return float(min(max(current, -p[at.P_COIL_LIMIT]), p[at.P_COIL_LIMIT]))


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
def _drive_force(
    kind: int, value: float, rate: float, t: float, dt: float, s: Floats, p: Floats, h: Floats, steered: bool
) -> float:
    """Force in N of a drive at `value`, changing by `rate` per s; a coil's current advances. `steered`: `h` acts."""
    x, v = s[at.S_X], s[at.S_V]
    grip = coupling(x, t, h) if steered else 1.0
    if kind in (MAGNET, PAIR):
        driven = value - x
        if kind == PAIR:
            force = grip * pair_force(driven, s, p)
        else:
            fall = 1 + (driven / p[at.P_MAGNET_RANGE]) ** 2
            force = grip * (p[at.P_MAGNET_K] * driven / (fall * fall))
            s[at.S_PRESSING] = dipole_load(driven, h)
    elif kind in (COIL, INNER_VOLTAGE):
        moved = v if kind == COIL else s[at.S_INNER_V] - v
        emf = p[at.P_COIL_EMF] * moved + hidden_emf(moved, h)
        driven = s[at.S_CURRENT] = _coil_current(value, emf, dt, s[at.S_CURRENT], p)
        force = grip * p[at.P_COIL_GAIN] * effective_current(driven, h)
    elif kind == LINK:
        return link_force(value - x, p[at.P_LINK_K], h) + float(p[at.P_LINK_C] * (rate - v))
    else:
        return value
    if not steered:
        return float(force)
    remember_drive(driven, s, h)
    return delivered(force, s, h)


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
def _swing(force: float, dt: float, s: Floats, p: Floats, h: Floats) -> float:
    """Advance the inner mass by a step under `force`; its force on the body in N, at the positions of mid-step."""
    v = s[at.S_INNER_V]
    rate = v - s[at.S_V]
    offset = s[at.S_INNER_X] - s[at.S_X] + 0.5 * dt * rate
    force *= field_reach(offset, h)
    spring = spring_force(offset, rate, p)
    spring += suspension_force(offset, rate, h)
    s[at.S_INNER_V] = v + dt * (force - spring) / p[at.P_INNER_MASS]
    s[at.S_INNER_X] += 0.5 * dt * (v + s[at.S_INNER_V])
    return float(spring - p[at.P_REACTION] * force)


@compiled
def _move(
    v: float, mean: float, dt: float, hoop: float, s: Floats, p: Floats, h: Floats, tab: Floats, felt: tuple[bool, bool]
) -> None:
    """Wall and memories at the end of a step at speed `v`, `mean` on average; `felt`: `h` acts on level, force."""
    if v != 0.0:
        s[at.S_DIRECTION] = 1.0 if v > 0 else -1.0
    s[at.S_V] = v
    move_wall(mean, dt, hoop, s, p, h, tab)
    if felt[0]:
        remember_motion(mean, dt, s, h)
    if felt[1]:
        remember_stress(mean, dt, s, h)


@compiled
def _advance_pull(
    s: Floats, p: Floats, h: Floats, tab: Floats, profile: Floats, drive: Floats, dt: float, every: int, out: Floats
) -> int:
    """`F = m a + R(|v|) Sgn(v) + F_v(w) + T(u) - F_hidden`; at rest R keeps the last direction."""
    rows, step = 0, int(s[at.S_STEP])
    leveled, forced = has_level(h), has_force(h)
    due = -step % every
    for k in range(drive.shape[0] - 1):
        x, t = drive[k], (step + k) * dt
        v = (drive[k + 1] - x) / dt
        if abs(v) < _LEAST_M_S:
            v = 0.0
        hoop = p[at.P_HOOP] * profile_level(x, p, profile)
        s[at.S_X] = x
        if k == due:
            came = s[at.S_V]
            seen = hoop * resistance_level(x, came, t, s, h) if leveled else hoop
            force = inertia(p, h) * (v - came) / dt + p[at.P_OFFSET]
            limit = sliding_limit(came, seen, s, p, tab)
            if leveled:
                limit = resistance_at_nose(limit, came, h)
                seen = hoop_at_slip(seen, x, h)
            force += s[at.S_DIRECTION] * limit + wall_force(came, seen, s, p, h, tab)
            _write_row(out[rows], t, s, force - (hidden_force(x, came, t, s, p, h) if forced else 0.0), x)
            rows += 1
            due += every
        if leveled:
            hoop = hoop_at_slip(hoop * resistance_level(x, v, t, s, h), x, h)
        s[at.S_X] = drive[k + 1]
        _move(v, v, dt, hoop, s, p, h, tab, (leveled, forced))
    s[at.S_STEP] += drive.shape[0] - 1
    return rows


@compiled
def advance(
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
    """Steps of `dt` under `drive[0], drive[1], ...`, one more value than steps, a row of `out` every `every` steps; `s`
    changes in place. Returns the number of rows. Steps that cannot change anything are skipped.

    `m a = F_act - R Sgn(v) - F_v(w) - T(u) + F_hidden`, R set-valued: the impulse that would stop the body is clipped
    to what R can give. First order in `dt`.

    An inner mass, `M_m X_m'' = -F_i + F`, pushes with `F_act = F_i - a F`, a = 1 with the reaction on the body, 0 for
    an external field. Second order while nothing sticks or hits, exact for PWM edges.
    """
    if kind == PULL:
        return _advance_pull(s, p, h, tab, profile, drive, dt, every, out)
    rows, step, mass = 0, int(s[at.S_STEP]), inertia(p, h)
    leveled, forced, steered = has_level(h), has_force(h), has_drive(h)
    unchanging, held = not (leveled or forced or steered) and kind < COIL, False
    due = -step % every
    for k in range(drive.shape[0] - 1):
        if held and k != due and drive[k] == drive[k - 1] and drive[k + 1] == drive[k]:
            continue
        t = (step + k) * dt
        x, v = s[at.S_X], s[at.S_V]
        force = _drive_force(kind, drive[k], (drive[k + 1] - drive[k]) / dt, t, dt, s, p, h, steered)
        if k == due:
            _write_row(out[rows], t, s, force, drive[k])
            rows += 1
            due += every
        if kind >= INNER_FORCE:
            force = _swing(force, dt, s, p, h)
        hoop = p[at.P_HOOP] * profile_level(x, p, profile)
        if leveled:
            hoop *= resistance_level(x, v, t, s, h)
        limit = sliding_limit(v, hoop, s, p, tab)
        if leveled:
            limit = resistance_at_nose(limit, v, h)
            hoop = hoop_at_slip(hoop, x, h)
        net = force - p[at.P_OFFSET] - wall_force(v, hoop, s, p, h, tab)
        if kind in (MAGNET, PAIR):
            limit += sideways_load(drive[k] - x, h)
        if forced:
            net += hidden_force(x, v, t, s, p, h)
        after = clipped_speed(v, net, limit, kinetic_limit(v, limit, p), mass, dt)
        mean = 0.5 * (v + after) if kind >= INNER_FORCE else after
        s[at.S_X] = x + dt * mean
        _move(after, mean, dt, hoop, s, p, h, tab, (leveled, forced))
        held = unchanging and v == 0.0 and after == 0.0 and s[at.S_SLIP] == 0.0
    s[at.S_STEP] += drive.shape[0] - 1
    return rows
