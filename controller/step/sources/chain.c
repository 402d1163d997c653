/* The best controller that works, else the next, else a controlled stop; every command passes the limits last. */
#include "internal.h"

#define SERIOUS (CAPSULE_LIMIT_RANGE | CAPSULE_LIMIT_GAP | CAPSULE_LIMIT_SPEED | CAPSULE_LIMIT_TEMPERATURE)
#define NEVER ((double)INFINITY)
#define FORGOTTEN R(0.5)     /* s of oscillation far from the aim that a second of following cancels */
#define FULL R(0.99)         /* share of the full rate above which a carriage moves at full rate */
#define SMALL_SWING R(0.25)  /* of `swing_m`, least error of a swing that grows */
#define GROWS R(1.5)         /* times as far as two swings before */
#define CALMEST R(0.0625)    /* least share of the first gain of the feedforward's loop */
#define FEEDFORWARD CAPSULE_MPC
#define PID (CAPSULE_MPC + 1)

static int about(int reason, int rank)
{
    return reason | (rank + 1) << 8;
}

static void note(capsule_controller *c, capsule_out *out, int after, int reason)
{
    if (out->events < CAPSULE_EVENTS) {
        capsule_event *event = &out->event[out->events++];
        event->before = c->active;
        event->after = after;
        event->reason = reason;
    }
}

static void forget_swings(capsule_controller *c)
{
    int k;
    c->swings = 0;
    c->growing = 0;
    c->swing_side = 0;
    c->swing_far_at = -NEVER;
    for (k = 0; k < 4; k++) {
        c->peaks[k] = 0;
    }
    c->peaks_seen = 1;
    c->peak_side = 0;
    c->peak_at = -NEVER;
}

static void start_chain(capsule_controller *c, double now, int reason)
{
    int rank;
    for (rank = 0; rank < CAPSULE_RANKS; rank++) {
        c->closed_until[rank] = -NEVER;
        c->wait[rank] = c->numbers->retry_s;
        c->good_since[rank] = NEVER;
        c->banned[rank] = 0;
    }
    c->blend_step = 0;
    c->blend_since = -NEVER;
    c->blend_left = 0;
    c->now_s = now;
    c->elapsed_s = 0;
    c->tick_s = 0;
    c->active = -1;
    c->reason = reason;
    c->bad_until = -NEVER;
    c->rest_since = NEVER;
    c->limited_since = NEVER;
    c->unfollowed_s = 0;
    c->stopped_at = NEVER;
    c->stop_from = 0;
#if !CAPSULE_SHAKEN
    c->gain = c->numbers->loop_gain_1_s;
    c->most_m_s = c->numbers->loop_most_m_s;
#endif
    forget_swings(c);
}

static capsule_seen seen_in(const capsule_belief *b, const capsule_in *in, const capsule_numbers *n)
{
    const real age = R(in->time_s - b->time_s);
    capsule_seen seen;
    seen.position_m = b->state[0];
    seen.speed_m_s = b->state[1];
    seen.std_m = b->std[0];
    seen.lost = b->lost;
    seen.temperature_C = in->temperature_C;
    seen.age_s = age >= -n->most_longest_tick_s ? (age > 0 ? age : R(0)) : R(INFINITY);
    return seen;
}

void capsule_controller_init(capsule_controller *c, const capsule_numbers *numbers, double begin_s,
                             const capsule_belief *belief, real command)
{
    capsule_issued before;
    capsule_seen seen;
    memset(c, 0, sizeof *c);
    c->numbers = numbers;
    before.command = command;
    before.rate = 0;
    before.aim = R(NAN);
    seen.position_m = belief->state[0];
    seen.speed_m_s = belief->state[1];
    seen.std_m = belief->std[0];
    seen.lost = belief->lost;
    seen.age_s = 0;
    seen.temperature_C = 0;
    c->issued = capsule_limited(numbers, R(NAN), before, &seen, R(0), &c->broken);
    start_chain(c, begin_s, CAPSULE_START);
#if CAPSULE_MPC
    capsule_mpc_reset(&c->planner, begin_s, c->issued.command);
#endif
}

void capsule_continue(capsule_controller *c, const capsule_controller *before)
{
    c->issued = before->issued;
    c->halted = before->halted;
    start_chain(c, before->now_s, CAPSULE_TAKEN_OVER);
}

/* Since when capsule and reference have been at rest. */
static void watch_rest(capsule_controller *c, const capsule_seen *seen, const capsule_in *in)
{
    const real most = c->numbers->rest_speed_m_s;
    const int resting = !seen->lost && real_abs(seen->speed_m_s) <= most && real_abs(in->speed_m_s[0]) <= most;
    c->rest_since = resting ? (c->rest_since < c->elapsed_s ? c->rest_since : c->elapsed_s) : NEVER;
}

/* The safe state of the drive; a current ramps down from its value at the stop. */
static real stop(capsule_controller *c, capsule_out *out, int reason)
{
    real left = 0;
    if (c->stopped_at >= NEVER) {
        note(c, out, -1, reason);
        c->reason = CAPSULE_RECOVERED;
        c->active = -1;
        c->stopped_at = c->elapsed_s;
        c->stop_from = c->issued.command;
    }
    out->status = CAPSULE_STOPPED;
    if (CAPSULE_PLACED) {
        return c->issued.command;
    }
    if (!CAPSULE_SHAKEN && c->numbers->stop_s > 0) {
        left = within(R(1) - R(c->elapsed_s - c->stopped_at) / c->numbers->stop_s, R(0), R(1));
    }
    return left * c->stop_from;
}

static void suspend(capsule_controller *c, int rank)
{
    const capsule_numbers *n = c->numbers;
    const double until = c->elapsed_s + (double)c->wait[rank];
    const real longest = n->retry_longest_s > n->retry_s ? n->retry_longest_s : n->retry_s;
    c->closed_until[rank] = c->closed_until[rank] > until ? c->closed_until[rank] : until;
    c->wait[rank] = R(2) * c->wait[rank] < longest ? R(2) * c->wait[rank] : longest;
    c->good_since[rank] = NEVER;
}

static void worked(capsule_controller *c, int rank)
{
    c->good_since[rank] = c->good_since[rank] < c->elapsed_s ? c->good_since[rank] : c->elapsed_s;
    if (c->elapsed_s - c->good_since[rank] >= (double)c->numbers->forgive_s) {
        c->wait[rank] = c->numbers->retry_s;
    }
}

#if CAPSULE_SHAKEN
static real answered(capsule_controller *c, int rank, const capsule_belief *b, const capsule_in *in, capsule_out *out)
{
    if (rank != c->active) {
        capsule_shaker_begin(&c->shaker, c->numbers, in->time_s, b->state[0]);
    }
    return capsule_shake(&c->shaker, c->numbers, b, in, out);
}
#else
static void reset(capsule_controller *c, int rank, double now)
{
    if (rank == PID) {
        c->pid_sum = 0;
        c->pid_start = c->issued.command;
    } else if (rank == FEEDFORWARD) {
        c->returning = 0;
    }
#if CAPSULE_MPC
    else {
        capsule_mpc_reset(&c->planner, now, c->issued.command);
    }
#endif
    (void)now;
}

static real answered(capsule_controller *c, int rank, const capsule_belief *b, const capsule_in *in, capsule_out *out)
{
    const int changed = rank != c->active;
    (void)out;
    if (changed) {
        reset(c, rank, in->time_s);
    }
    c->continued = c->issued.command - (changed ? R(0) : c->blend_left);
#if CAPSULE_MPC
    if (rank == 0) {
        real found = R(NAN);
        const int planned = capsule_mpc(c->numbers, &c->planner, b, in, c->continued, c->issued.rate, &found);
        out->iterations = c->planner.iterations;
        out->plans = c->planner.steps;
        return planned != 0 ? found : R(NAN);
    }
#endif
    return rank == PID ? capsule_pid(c, b, in) : capsule_feedforward(c, b, in);
}
#endif

/* The answer of one controller of the chain; NaN for none. */
static real asked(capsule_controller *c, int rank, const capsule_belief *b, const capsule_in *in, capsule_out *out)
{
    const int changed = rank != c->active;
    const real command = answered(c, rank, b, in, out);
    if (changed && isfinite(command)) {
        const real running = CAPSULE_PLACED ? c->issued.rate * c->tick_s : R(0);
        note(c, out, rank, rank < c->active ? CAPSULE_TRIED_AGAIN : c->reason);
        c->active = rank;
        c->stopped_at = NEVER;
        c->blend_step = CAPSULE_SHAKEN ? R(0) : c->issued.command + running - command;
        c->blend_since = c->elapsed_s;
    }
    return command;
}

/* `command` plus what remains of the step at the last change-over. */
static real blended(capsule_controller *c, real command)
{
    const real since = R(c->elapsed_s - c->blend_since), time = c->numbers->blend_s;
    const real share = time > 0 ? R(1) - (since > 0 ? since : R(0)) / time : R(0);
    c->blend_left = share > 0 ? c->blend_step * share : R(0);
    return command + c->blend_left;
}

static real decide(capsule_controller *c, const capsule_seen *seen, const capsule_belief *b, const capsule_in *in,
                   capsule_out *out)
{
    const int blind = seen->lost || !(seen->age_s <= c->numbers->oldest_s)
        || !isfinite(seen->position_m + seen->speed_m_s);
    int rank;
    if (c->halted) {
        return stop(c, out, c->reason);
    }
    if (blind) {
        c->bad_until = c->elapsed_s + (double)c->numbers->settle_s;
    }
    if (blind || c->elapsed_s < c->bad_until) {
        const real command = stop(c, out, CAPSULE_ESTIMATE_LOST);
        out->status = CAPSULE_LOST;
        return command;
    }
    for (rank = 0; rank < CAPSULE_RANKS; rank++) {
        if (!c->banned[rank] && c->elapsed_s >= c->closed_until[rank]) {
            const real command = asked(c, rank, b, in, out);
            if (isfinite(command)) {
                worked(c, rank);
                return blended(c, command);
            }
            out->status = CAPSULE_FAILED;
            c->reason = about(CAPSULE_ANSWERED, rank);
            suspend(c, rank);
        }
    }
    return stop(c, out, c->reason);
}

static void too_long(capsule_controller *c, int limits)
{
    c->reason = about(CAPSULE_TOO_LONG, c->active) | limits << 16;
    suspend(c, c->active);
    c->limited_since = NEVER;
    c->unfollowed_s = 0;
}

/* Serious limits in force too long are a failure, as are commands that no carriage can follow. */
static void watch_limits(capsule_controller *c, int broken)
{
    const capsule_numbers *n = c->numbers;
    const real braking_m = isfinite(n->acceleration) ? R(0.5) * n->rate * n->rate / n->acceleration : R(INFINITY);
    const real turning = real_abs(c->issued.rate) < FULL * n->rate ? R(1) : R(0);
    const int far = real_abs(c->issued.aim - c->issued.command) > braking_m;
    if (c->active < 0 || (broken & SERIOUS) == 0) {
        c->limited_since = NEVER;
    } else if (c->limited_since >= NEVER) {
        c->limited_since = c->elapsed_s;
    } else if (c->elapsed_s - c->limited_since >= (double)n->limit_s) {
        too_long(c, broken & SERIOUS);
    }
    c->unfollowed_s += (far ? turning : -FORGOTTEN) * c->tick_s;
    if (c->active < 0 || !(c->unfollowed_s > 0)) {
        c->unfollowed_s = 0;
    }
    if (c->unfollowed_s >= n->limit_s) {
        too_long(c, CAPSULE_LIMIT_RATE);
    }
}

static int swing_grew(const capsule_controller *c)
{
    const real *peak = c->peaks;
    const real last = GROWS * peak[1] > R(0.5) * c->numbers->swing_m ? GROWS * peak[1] : R(0.5) * c->numbers->swing_m;
    return c->peaks_seen >= 4 && peak[0] > 0 && peak[2] >= GROWS * peak[0] && peak[3] >= last;
}

/* Counts in a row how often the capsule goes from far on one side of its reference to the other. */
static void see_swing(capsule_controller *c, real error_m)
{
    const capsule_numbers *n = c->numbers;
    const double now = c->elapsed_s;
    const real size = real_abs(error_m), side = real_copysign(R(1), error_m);
    int k;
    if (now - c->peak_at > (double)n->swing_s) {
        forget_swings(c);
    }
    if (now - c->swing_far_at > (double)n->swing_s) {
        c->swings = 0;
        c->swing_side = 0;
    }
    if (size >= SMALL_SWING * n->swing_m) {
        if (side * c->peak_side <= 0) {
            for (k = 0; k < 3; k++) {
                c->peaks[k] = c->peaks[k + 1];
            }
            c->peaks[3] = 0;
            c->peaks_seen = c->peaks_seen < 4 ? c->peaks_seen + 1 : 4;
        }
        c->peaks[3] = size > c->peaks[3] ? size : c->peaks[3];
        c->peak_side = side;
        c->peak_at = now;
        c->growing = c->growing || swing_grew(c);
    }
    if (size >= n->swing_m) {
        c->swings += side * c->swing_side < 0;
        c->swing_side = side;
        c->swing_far_at = now;
    }
}

/* Halves the gain of the feedforward's loop; the others have none. */
static int calmed(capsule_controller *c)
{
#if CAPSULE_SHAKEN
    (void)c;
    return 0;
#else
    if (c->active != FEEDFORWARD || c->gain <= CALMEST * c->numbers->loop_gain_1_s) {
        return 0;
    }
    c->gain *= R(0.5);
    c->most_m_s *= R(0.5);
    return 1;
#endif
}

/* A controller that swings far and often must reduce its gain; one that cannot is suspended for good. */
static void watch_swings(capsule_controller *c, const capsule_seen *seen, const capsule_in *in, capsule_out *out)
{
    int rank, far, calm, left = 0;
    see_swing(c, seen->lost ? R(NAN) : seen->position_m - in->position_m[0]);
    far = R(c->swings) >= c->numbers->swings;
    if (c->active < 0 || (!far && !c->growing)) {
        return;
    }
    calm = calmed(c);
    if (calm || far) {
        forget_swings(c);
    }
    if (calm) {
        note(c, out, c->active, about(CAPSULE_SWINGS, c->active));
    }
    if (calm || !far) {
        return;
    }
    c->reason = about(CAPSULE_SWINGS, c->active);
    c->banned[c->active] = 1;
    for (rank = 0; rank < CAPSULE_RANKS; rank++) {
        left += c->banned[rank] ? 0 : 1;
    }
    if (left == 0) {
        c->halted = 1;
        c->reason = about(CAPSULE_NONE_LEFT, c->active);
    }
}

/* `wanted` within the bounds of the call, between which a stop still goes to 0. */
static real bounded(const capsule_controller *c, real wanted, const capsule_in *in)
{
    const int stops = c->active < 0;
    const real low = stops && in->least > 0 ? R(0) : in->least, high = stops && in->most < 0 ? R(0) : in->most;
    wanted = wanted < low ? low : wanted;
    return wanted > high ? high : wanted;
}

void capsule_control(capsule_controller *c, const capsule_belief *b, const capsule_in *in, capsule_out *out)
{
    const capsule_numbers *n = c->numbers;
    const double dt = in->time_s - c->now_s;
    capsule_seen seen;
    real wanted;
    memset(out, 0, sizeof *out);
    c->now_s = isfinite(in->time_s) ? in->time_s : c->now_s;
    c->tick_s = dt > 0.0 ? (dt < (double)n->most_longest_tick_s ? R(dt) : n->most_longest_tick_s) : R(0);
    c->elapsed_s += c->tick_s;
    if (in->halt != 0 && !c->halted) {
        c->halted = 1;
        c->reason = CAPSULE_HALTED;
    }
    seen = seen_in(b, in, n);
    watch_rest(c, &seen, in);
    wanted = decide(c, &seen, b, in, out);
    wanted = bounded(c, wanted, in);
    c->issued = capsule_limited(n, wanted, c->issued, &seen, c->tick_s, &c->broken);
    watch_limits(c, c->broken);
    watch_swings(c, &seen, in, out);
    if (c->broken != 0 && out->status == CAPSULE_OK) {
        out->status = CAPSULE_LIMITED;
    }
    out->command = c->issued.command;
    out->rate = c->issued.rate;
    out->active = c->active;
    out->limits = c->broken;
    out->halted = c->halted;
    out->lost = b->lost;
    out->position_m = b->state[0];
    out->speed_m_s = b->state[1];
    out->std_m = b->std[0];
    out->disturbance_N = b->lacking_N;
    out->friction_scale = R(1) + b->level;
    out->resting_s = c->rest_since < NEVER ? R(c->elapsed_s - c->rest_since) : R(-1);
}
