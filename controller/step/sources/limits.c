/* Limits: one function that every command passes last. */
#include "internal.h"

#define SHORTEST_TICK R(1e-6)
#define NEAR R(1e-9) /* share of the range within which two commands are equal */

/* Greatest rate w for dt that deceleration a still stops within `room`: w dt + w^2/(2 a) = room. */
static real braking(real room, real dt, real a)
{
    return a * dt * (real_sqrt(R(1) + R(2) * (room > 0 ? room : R(0)) / (a * dt * dt)) - R(1));
}

/* The part of `aim` reachable within dt under rate and acceleration, so that it stops within the room. */
static capsule_issued reached(const capsule_numbers *n, real aim, real before, real rate, real last_aim, real dt,
                              real share, const real *room)
{
    capsule_issued issued;
    issued.aim = aim;
    if (dt <= 0) {
        issued.command = before;
        issued.rate = rate;
    } else if (isinf(n->rate)) {
        issued.command = aim;
        issued.rate = 0;
    } else {
        const real fastest = n->rate * (CAPSULE_PLACED ? share : R(1)), a = n->acceleration;
        real able = within((aim - before) / dt, -fastest, fastest), raw;
        if (isfinite(a)) {
            const real along = isfinite(last_aim) ? within((aim - last_aim) / dt, -fastest, fastest) : R(0);
            const real behind = aim - before - along * dt;
            able = within(along + real_copysign(braking(real_abs(behind), dt, a), behind), -fastest, fastest);
            able = within(able, -braking(before - room[0], dt, a), braking(room[1] - before, dt, a));
            able = within(able, rate - a * dt, rate + a * dt);
        }
        raw = before + able * dt;
        issued.command = within(raw, n->low, n->high);
        issued.rate = raw >= n->low && raw <= n->high ? able : R(0);
    }
    return issued;
}

static real clipped(real aim, real low, real high, int bit, int *broken)
{
    const real found = within(aim, low, high);
    if (found < aim || found > aim) {
        *broken |= bit;
    }
    return found;
}

/* The carriage's range within the gap in which the magnet holds, less a margin for the position's uncertainty. */
static void narrowed(const capsule_numbers *n, const capsule_seen *seen, real *room)
{
    const real margin = n->most_gap_stds * seen->std_m, left = n->gap_m - margin;
    const real gap = margin >= 0 && left > 0 ? left : R(0);
    room[0] = within(seen->position_m - gap, n->low, n->high);
    room[1] = within(seen->position_m + gap, n->low, n->high);
}

capsule_issued capsule_limited(const capsule_numbers *n, real wanted, capsule_issued previous, const capsule_seen *seen,
                               real dt, int *broken)
{
    const real x = seen->position_m, v = seen->speed_m_s, warm = seen->temperature_C;
    const int unasked = !isfinite(wanted);
    const int possible = isfinite(x) && (!CAPSULE_PLACED || (n->low - n->gap_m <= x && x <= n->high + n->gap_m));
    const int blind = seen->lost || !(seen->age_s >= 0 && seen->age_s <= n->oldest_s && isfinite(v) && possible);
    real before = previous.command, rate = previous.rate, aim = wanted, share, left, room[2];
    capsule_issued issued;
    *broken = 0;
    if (!(before >= n->low && before <= n->high && real_abs(rate) <= n->rate)) {
        *broken |= CAPSULE_LIMIT_PREVIOUS;
        if (!isfinite(before)) {
            before = CAPSULE_PLACED ? (isfinite(x) ? x : R(0.5) * (n->low + n->high)) : R(0);
        }
        before = within(before, n->low, n->high);
        rate = 0;
    }
    dt = dt >= SHORTEST_TICK ? (dt < n->most_longest_tick_s ? dt : n->most_longest_tick_s) : R(0);
    share = within((n->most_temperature_C - warm) / (n->most_temperature_C - n->most_derate_C), R(0), R(1));
    share = isnan(warm) ? R(0) : share;
    *broken |= share < 1 ? CAPSULE_LIMIT_TEMPERATURE : 0;
    *broken |= unasked ? CAPSULE_LIMIT_COMMAND : 0;
    *broken |= blind ? CAPSULE_LIMIT_ESTIMATE : 0;
    if (blind || unasked) {
        aim = CAPSULE_PLACED ? before : R(0);
    }
    left = CAPSULE_PLACED ? R(1) : share;
    aim = clipped(aim, left * n->low, left * n->high, CAPSULE_LIMIT_RANGE, broken);
    room[0] = n->low;
    room[1] = n->high;
    if (!blind && CAPSULE_PLACED) {
        narrowed(n, seen, room);
        aim = clipped(aim, room[0], room[1], CAPSULE_LIMIT_GAP, broken);
    }
    if (!CAPSULE_SHAKEN && !blind && real_abs(v) > n->most_speed_m_s) {
        const real most = CAPSULE_PLACED ? before : R(0);
        const int onwards = v * n->sense > 0;
        aim = clipped(aim, onwards ? R(-INFINITY) : most, onwards ? most : R(INFINITY), CAPSULE_LIMIT_SPEED, broken);
    }
    issued = reached(n, aim, before, rate, previous.aim, dt, share, room);
    if (real_abs(issued.command - aim) > NEAR * (n->high - n->low)) {
        *broken |= CAPSULE_LIMIT_RATE;
    }
    return issued;
}
