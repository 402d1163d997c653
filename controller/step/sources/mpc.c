/* The model predictive controller: from estimate and reference to the next command. */
#include "internal.h"

#if CAPSULE_MPC
#define N CAPSULE_STAGES
#define REST_S R(0.05)  /* a capsule that takes longer to cross the band counts as resting */
#define REST_STDS R(3)  /* standard deviations of the estimate that count as rest */
#define WIDEST R(3)     /* times `rest_m`, for any estimate */
#define CALM R(0.99)    /* share of the greatest change of rate below which a plan is followed */
#define SAME R(1e-9)    /* share of the range within which two commands are equal */

void capsule_mpc_reset(capsule_planner *p, double now, real command)
{
    int k;
    p->command = command;
    p->rate = 0;
    p->time_s = now;
    p->resting = 0;
    p->followable = 0;
    for (k = 0; k <= N; k++) {
        p->shifted[k] = command;
    }
}

static void halt(capsule_planner *p)
{
    int k;
    p->rate = 0;
    p->followable = 0;
    for (k = 0; k <= N; k++) {
        p->shifted[k] = p->command;
    }
}

/* A row of one value a stage, `stages` after the first, linear between. */
static real along(const real *values, int stride, real stages)
{
    const int last = N - 1, whole = stages < R(last) ? (int)stages : last;
    const real here = values[whole * stride], there = values[(whole + 1) * stride];
    return here + (stages - R(whole)) * (there - here);
}

/* The last plan's command for this tick; 0 if a new plan is due. */
static int foreseen(const capsule_numbers *n, const capsule_planner *p, const real *state, double now, real *command)
{
    const real age = R(now - p->time_s);
    if (!p->followable || !(age > 0 && age < n->hold_s - R(0.5) * n->tick_s)
        || !(real_abs(state[0] - along(&p->best.path[0][0], CAPSULE_STATES, age / n->stage_s)) <= n->hold_m)) {
        return 0;
    }
    *command = along(p->best.commands, 1, (age + n->tick_s) / n->stage_s);
    return 1;
}

/* Whether the rates of all stages in which a plan may be followed, and of the next one, differ by less than a tick's
   acceleration. */
static int is_calm(const capsule_numbers *n, const capsule_planner *p)
{
    const int ahead = (int)real_ceil(n->hold_s / n->stage_s) + 1;
    real before = p->rate;
    int k;
    for (k = 0; k < ahead && k < N; k++) {
        const real rate = (p->best.commands[k + 1] - p->best.commands[k]) / n->stage_s;
        if (!(real_abs(rate - before) < CALM * n->acceleration * n->tick_s)) {
            return 0;
        }
        before = rate;
    }
    return 1;
}

/* Whether to leave the capsule alone: as near as the estimate can tell. */
static int rests(const capsule_numbers *n, capsule_planner *p, const real *state, real std_m)
{
    const real spread = REST_STDS * std_m < WIDEST * n->rest_m ? REST_STDS * std_m : WIDEST * n->rest_m;
    const real band = spread > n->rest_m ? spread : n->rest_m, speed = real_abs(state[1]);
    int still = real_abs(state[0] - p->targets[0][0]) < (p->resting ? R(2) : R(1)) * band
        && real_abs(p->rate) * n->tick_s < n->rest_m, k;
    for (k = 0; k <= N; k++) {
        still = still && real_abs(p->targets[1][k]) <= 0 && real_abs(p->targets[0][k] - p->targets[0][0]) <= 0;
    }
    p->resting = still && (p->resting || speed < n->rest_m / REST_S);
    return p->resting;
}

/* The reference over the horizon; whether it is numbers, as the estimate. */
static int aimed(const capsule_numbers *n, capsule_planner *p, const capsule_belief *b, const capsule_in *in)
{
    real sum = b->lacking_N + R(in->time_s);
    int k;
    for (k = 0; k < CAPSULE_STATES; k++) {
        sum += b->state[k];
    }
    for (k = 0; k <= N; k++) {
        p->targets[0][k] = in->position_m[k];
        p->targets[1][k] = in->speed_m_s[k];
        p->targets[2][k] = n->follows * in->speed_m_s[k];
        sum += in->position_m[k] + in->speed_m_s[k];
    }
    return isfinite(sum);
}

/* The last plan from now on, continued at the reference's rate, from the command in force. */
static void guess_from_last(const capsule_numbers *n, capsule_planner *p, double now)
{
    const real passed = R(now - p->time_s) / n->stage_s;
    int k;
    for (k = 0; k <= N; k++) {
        const real at = passed + R(k), beyond = at > R(N) ? (at - R(N)) * n->stage_s : R(0);
        p->guess[k] = along(p->shifted, 1, within(at, R(0), R(N))) + beyond * p->targets[2][N];
    }
    p->guess[0] = p->command;
}

/* The parameters to plan with, and the disturbance beside them. */
static real learned(const capsule_numbers *n, capsule_planner *p, const capsule_belief *b)
{
    real sum = b->force_N;
    int k, usable;
    for (k = 0; k < CAPSULE_PARAMETERS; k++) {
        sum += b->parameters[k];
    }
    usable = b->learned && isfinite(sum);
    memcpy(p->parameters, usable ? b->parameters : n->parameters, sizeof p->parameters);
#if CAPSULE_GRIP >= 0
    p->parameters[CAPSULE_GRIP] *= R(1) + n->late_slip;
#endif
    return usable ? b->force_N : b->lacking_N;
}

int capsule_mpc(const capsule_numbers *n, capsule_planner *p, const capsule_belief *b, const capsule_in *in,
                real in_force, real in_force_rate, real *command)
{
    static const int modes[] = CAPSULE_MODES;
    const double now = in->time_s;
    real state[CAPSULE_STATES], d;
    int i, settled;
    p->steps = 0;
    p->iterations = 0;
    if (real_abs(in_force - p->command) > SAME * (n->high - n->low)) {
        p->command = in_force;
        p->rate = in_force_rate;
        p->followable = 0;
    }
    memcpy(state, b->state, sizeof state);
    if (foreseen(n, p, state, now, command)) {
        p->rate = (*command - p->command) / n->tick_s;
        p->command = *command;
        return 1;
    }
    if (!aimed(n, p, b, in)) {
        halt(p);
        return 0;
    }
    *command = p->command;
    if (rests(n, p, state, b->std[0])) {
        halt(p);
        return 1;
    }
    for (i = 0; modes[i] >= 0; i++) {
        const real mode = state[modes[i]];
        state[modes[i]] = mode > R(0.5) ? R(1) : (mode < R(-0.5) ? R(-1) : R(0));
    }
    guess_from_last(n, p, now);
    d = learned(n, p, b);
    settled = capsule_planned(n, p, state, d, now, p->rate);
    if (settled < 0) {
        halt(p);
        return 0;
    }
    p->followable = settled && is_calm(n, p);
    p->rate = (p->best.commands[1] - p->best.commands[0]) / n->stage_s;
    memcpy(p->shifted, p->best.commands, sizeof p->shifted);
    p->time_s = now;
    p->command = along(p->best.commands, 1, n->tick_s / n->stage_s);
    *command = p->command;
    return 1;
}
#else
typedef int capsule_no_mpc;
#endif
