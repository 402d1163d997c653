/* Feedforward: the control model inverted along the reference, with a slow position loop; and the PID below it. */
#include "internal.h"

#if !CAPSULE_SHAKEN
#define EVALUATIONS 30   /* of the model per command at most */
#define ACCURACY R(1e-4) /* of the command as a share of its range */
#define JUMP_S R(1e-7)   /* step from the command in force to the tried one */
#define JUMP_STEPS 4
#define LOOSE R(2)       /* factor on the command for break-away beyond that for motion */
#define BISECTIONS 60

static void advance(real *x, real c0, real c1, real d, real t, real span, int steps, const real *q)
{
    const real h = span / R(steps), rise = (c1 - c0) / R(steps);
    int j;
    for (j = 0; j < steps; j++) {
        const real c = c0 + R(j) * rise;
        capsule_sharp_step(x, c, c + rise, d, t + R(j) * h, h, q);
    }
}

/* Speed in m/s after `reach_s` under `command`; `before`: the command in force, which the model may remember. */
static real speed_after(const capsule_numbers *n, const real *state, real before, real command, real d, real t,
                        const real *q)
{
    real x[CAPSULE_STATES];
    memcpy(x, state, sizeof x);
    if (CAPSULE_REMEMBERS && !isnan(before)) {
        advance(x, before, command, d, t, JUMP_S, JUMP_STEPS, q);
    }
    advance(x, command, command, d, t, n->reach_s, CAPSULE_REACH_SUBSTEPS, q);
    return x[1];
}

static int all_finite(const real *x, int count)
{
    int i, sound = 1;
    for (i = 0; i < count; i++) {
        sound = sound && isfinite(x[i]);
    }
    return sound;
}

/* The command under which the model goes from `state` to `speed` within `reach_s`: a bracket that closes (regula
   falsi, Illinois), as the speed grows with the command. At the end of the range if none is enough. */
static real inverted(const capsule_controller *c, const capsule_belief *b, const real *state, real speed, real t)
{
    const capsule_numbers *n = c->numbers;
    const real *q = b->learned ? b->parameters : n->parameters;
    const real d = b->learned ? b->force_N : b->lacking_N, before = c->continued;
    real low = n->low, high = n->high, below, above, near;
    int k, last = 0;
#if CAPSULE_PLACED
    low = low > state[0] - n->gap_m ? low : state[0] - n->gap_m;
    high = high < state[0] + n->gap_m ? high : state[0] + n->gap_m;
#endif
    if (!isfinite(low + high + d + speed) || !all_finite(state, CAPSULE_STATES)) {
        return R(NAN);
    }
    below = speed_after(n, state, before, low, d, t, q) - speed;
    above = speed_after(n, state, before, high, d, t, q) - speed;
    if (below * above >= 0) {
        return real_abs(below) < real_abs(above) ? low : high;
    }
    near = ACCURACY * (high - low);
    for (k = 0; k < EVALUATIONS && high - low > near && !isnan(below + above); k++) {
        const real margin = R(0.02) * (high - low);
        const real middle = within((low * above - high * below) / (above - below), low + margin, high - margin);
        const real error = speed_after(n, state, before, middle, d, t, q) - speed;
        if (error * above > 0) {
            high = middle;
            above = error;
            below = last == 1 ? R(0.5) * below : below;
            last = 1;
        } else {
            low = middle;
            below = error;
            above = last == -1 ? R(0.5) * above : above;
            last = -1;
        }
    }
    return R(0.5) * (low + high);
}

/* Speed beyond the reference's that reduces `error` in m. */
static real correction(capsule_controller *c, real error, real speed)
{
    const capsule_numbers *n = c->numbers;
    const real wanted = within(c->gain * error, -c->most_m_s, c->most_m_s);
    if (real_abs(speed) > n->loop_rest_m_s) {
        const real least = real_abs(wanted) < real_abs(speed) ? real_abs(wanted) : real_abs(speed);
        c->returning = 0;
        return wanted * speed < 0 && real_abs(error) < n->loop_noise_m ? real_copysign(least, wanted) : wanted;
    }
    c->returning = real_abs(error) > (c->returning ? R(0.5) : R(1)) * n->loop_slack_m;
    return c->returning ? wanted : R(0);
}

real capsule_feedforward(capsule_controller *c, const capsule_belief *b, const capsule_in *in)
{
    const real t = R(in->time_s);
    const real more = correction(c, in->position_m[0] - b->state[0], in->next_speed_m_s);
    const real wanted = in->next_speed_m_s + more, seen = b->state[1];
    real state[CAPSULE_STATES], command;
    memcpy(state, b->state, sizeof state);
    state[1] = in->speed_m_s[0] + more;
    command = inverted(c, b, state, wanted, t);
    /* the base's friction grows with speed; with effects a slow capsule needs more than the command for motion */
    if (CAPSULE_EFFECTS && real_abs(wanted) > c->numbers->loop_rest_m_s && seen / wanted < 1) {
        const real push = c->numbers->sense * real_copysign(R(1), wanted), missing = R(1) - seen / wanted;
        real extra;
        state[1] = real_copysign(c->numbers->loop_rest_m_s, wanted);
        extra = push * (inverted(c, b, state, state[1], t) - command);
        command += push * (extra > 0 ? extra : R(0)) * LOOSE * (missing < 1 ? missing : R(1));
    }
    return command;
}

/* The command for a steady force: for a magnet the gap at which it pulls so, on its stable branch. */
static real command_for(const capsule_numbers *n, real force, real x, real v)
{
#if CAPSULE_PLACED
    const real wanted = real_abs(force);
    real low = 0, high = n->gap_m;
    int k;
    (void)v;
    if (capsule_drive_force(high, R(0), R(0), n->parameters) <= wanted) {
        return x + real_copysign(high, force);
    }
    for (k = 0; k < BISECTIONS; k++) {
        const real middle = R(0.5) * (low + high);
        if (capsule_drive_force(middle, R(0), R(0), n->parameters) <= wanted) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return x + real_copysign(low, force);
#else
    return within(capsule_drive_command(force, x, v, n->parameters), n->low, n->high);
#endif
}

real capsule_pid(capsule_controller *c, const capsule_belief *b, const capsule_in *in)
{
    const capsule_numbers *n = c->numbers;
    const real x = b->state[0], v = b->state[1], error = in->position_m[0] - x, most = n->pid_windup_N;
    const real free = n->pid_k_p * error + n->pid_k_d * (in->speed_m_s[0] - v);
    if (!isfinite(free)) {
        return R(NAN);
    }
    if (isfinite(c->pid_start)) { /* the first answer repeats the command in force */
        c->pid_sum = within(capsule_drive_force(c->pid_start, x, v, n->parameters) - free, -most, most);
        c->pid_start = R(NAN);
    }
    c->pid_sum = within(c->pid_sum + n->pid_k_i * error * n->tick_s, -most, most);
    return command_for(n, free + c->pid_sum, x, v);
}
#else
typedef int capsule_no_feedforward;
#endif
