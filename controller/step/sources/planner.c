/* From a state and a guess to a better plan: a few Gauss-Newton SQP steps with a line search. */
#include "internal.h"

#if CAPSULE_MPC
#define N CAPSULE_STAGES
#define S CAPSULE_STATES
#define FREE R(1e30)      /* no bound, for the solver */
#define EXCESS R(10)      /* weight of the square of the share by which a soft bound is exceeded */
#define NEAR R(0.6)       /* share of a bound above which it gets rows */
#define PRESSED R(0.5)    /* share of the bound on the wall's force above which every trial computes it */
#define ENOUGH R(5e-3)    /* least gain of a step, as a share of the cost, for another step */
#define LITTLE R(1e-6)    /* negligible cost */
#define CATCH_S R(0.03)   /* time constant with which a guess approaches the reference */

/* What a plan is made for. */
typedef struct {
    const capsule_numbers *n;
    const real *q;
    real d, t, rate;
    int pressed;
} task;

static real lesser(real a, real b)
{
    return a < b ? a : b;
}

static real greater(real a, real b)
{
    return a > b ? a : b;
}

static void stage_step(const task *its, real *x, real c0, real c1, int k)
{
    const real h = its->n->stage_s / R(CAPSULE_PLAN_SUBSTEPS), rise = (c1 - c0) / R(CAPSULE_PLAN_SUBSTEPS);
    int j;
    for (j = 0; j < CAPSULE_PLAN_SUBSTEPS; j++) {
        const real c = c0 + R(j) * rise;
        capsule_plan_step(x, c, c + rise, its->d, its->t + R(k) * its->n->stage_s + R(j) * h, h, its->q);
    }
}

/* Moves commands so that the hard bounds hold and they can stop within the range. The first one stays. */
static void keep_feasible(const task *its, real *commands)
{
    const real stage = its->n->stage_s, *hard = its->n->hard, low = hard[0], high = hard[1], most = hard[2];
    const real bend = hard[3];
    real rate = within(its->rate, -most, most);
    int k;
    for (k = 0; k < N; k++) {
        const real change = bend * (k == 0 ? its->n->tick_s : stage);
        const real ahead = greater(high - commands[k], R(0)), behind = greater(commands[k] - low, R(0));
        const real up = R(2) * ahead / (real_sqrt(stage * stage + R(2) * ahead / bend) + stage);
        const real down = R(2) * behind / (real_sqrt(stage * stage + R(2) * behind / bend) + stage);
        real wanted = (commands[k + 1] - commands[k]) / stage;
        wanted = lesser(lesser(greater(greater(wanted, -most), -down), most), up);
        wanted = within(wanted, rate - change, rate + change);
        commands[k + 1] = within(commands[k] + wanted * stage, low, high);
        rate = (commands[k + 1] - commands[k]) / stage;
    }
}

static real square(real x)
{
    return x * x;
}

/* The value that a soft bound limits: gap, speed, wall force. */
static real bounded(const capsule_planner *p, const capsule_plan *plan, int kind, int k)
{
    return kind == 0 ? plan->commands[k] - plan->path[k][0] : (kind == 1 ? plan->path[k][1] : p->forces[k]);
}

static real cost(const task *its, const capsule_planner *p, const capsule_plan *plan)
{
    const real *scales = its->n->scales, *soft = its->n->soft;
    real total = 0, rate = its->rate;
    int j, k;
    for (j = 0; j < 3; j++) {
        real worst = 0;
        for (k = 1; k <= N; k++) {
            worst = greater(real_abs(bounded(p, plan, j, k)) / soft[j] - R(1), worst);
        }
        total += its->n->penalty[j] * worst * (R(1) + R(0.5) * EXCESS * worst);
    }
    for (k = 1; k <= N; k++) {
        const real weight = k == N ? scales[4] : R(1);
        const real now = (plan->commands[k] - plan->commands[k - 1]) / its->n->stage_s;
        total += R(0.5) * weight * square((plan->path[k][0] - p->targets[0][k]) / scales[0])
            + R(0.5) * square((plan->path[k][1] - p->targets[1][k]) / scales[1])
            + R(0.5) * square((now - p->targets[2][k - 1]) / scales[2]) + R(0.5) * square((now - rate) / scales[3]);
        rate = now;
    }
    return total;
}

static void price(const task *its, capsule_planner *p, capsule_plan *plan)
{
    int i, k;
    if (its->pressed) {
        for (k = 0; k <= N; k++) {
            p->times[k] = its->t + R(k) * its->n->stage_s;
            for (i = 0; i < S; i++) {
                p->ends[i][k] = plan->path[k][i];
            }
        }
        capsule_plan_walls(p->ends, p->times, its->q, p->forces, p->slopes);
    }
    plan->cost = cost(its, p, plan);
}

/* Path and cost of a plan's commands within the hard bounds; the first `known` stages are predicted already. */
static void roll(const task *its, capsule_planner *p, capsule_plan *plan, int known)
{
    real before[N + 1], x[S];
    int k = 0;
    memcpy(before, plan->commands, sizeof before);
    keep_feasible(its, plan->commands);
    while (k < known && before[k + 1] >= plan->commands[k + 1] && before[k + 1] <= plan->commands[k + 1]) {
        k++;
    }
    memcpy(x, plan->path[k], sizeof x);
    for (; k < N; k++) {
        stage_step(its, x, plan->commands[k], plan->commands[k + 1], k);
        memcpy(plan->path[k + 1], x, sizeof x);
    }
    price(its, p, plan);
}

/* Commands that follow the reference by inverting the model; an error decays with CATCH_S. */
static void pursue(const task *its, const capsule_planner *p, capsule_plan *plan)
{
    const real *hard = its->n->hard, most = hard[2] * its->n->stage_s;
    real x[S];
    int k;
    memcpy(x, plan->path[0], sizeof x);
    for (k = 0; k < N; k++) {
        const real speed = p->targets[1][k + 1] + (p->targets[0][k + 1] - x[0]) / CATCH_S;
        const real c = capsule_plan_pursuit(x, speed, its->d, its->t + R(k) * its->n->stage_s, its->q);
        plan->commands[k + 1] = within(within(c, plan->commands[k] - most, plan->commands[k] + most), hard[0], hard[1]);
        stage_step(its, x, plan->commands[k], plan->commands[k + 1], k);
        memcpy(plan->path[k + 1], x, sizeof x);
    }
}

/* S <- J S, and the command's own derivatives, for all stages side by side. */
static void chain_rule(capsule_planner *p, real first, real last)
{
    real moved[S][N];
    int i, m, o, k;
    for (m = 0; m < S + 2; m++) {
        for (i = 0; i < S; i++) {
            for (k = 0; k < N; k++) {
                moved[i][k] = p->J[i][k] * p->by[0][m][k];
            }
            for (o = 1; o < S; o++) {
                for (k = 0; k < N; k++) {
                    moved[i][k] += p->J[S * o + i][k] * p->by[o][m][k];
                }
            }
        }
        for (i = 0; i < S; i++) {
            memcpy(p->by[i][m], moved[i], sizeof moved[i]);
        }
    }
    for (i = 0; i < S; i++) {
        for (k = 0; k < N; k++) {
            const real by_start = p->J[S * S + i][k], by_end = p->J[S * (S + 1) + i][k];
            p->by[i][S][k] += by_start * (R(1) - first) + by_end * (R(1) - last);
            p->by[i][S + 1][k] += by_start * first + by_end * last;
        }
    }
}

/* Derivatives of each stage's end by its begin and by the commands at both ends. */
static void linearise(const task *its, capsule_planner *p)
{
    const real h = its->n->stage_s / R(CAPSULE_PLAN_SUBSTEPS), *c = p->best.commands;
    int i, j, k, m;
    for (i = 0; i < S; i++) {
        for (k = 0; k < N; k++) {
            p->lanes[i][k] = p->best.path[k][i];
            for (m = 0; m < S + 2; m++) {
                p->by[i][m][k] = i == m ? R(1) : R(0);
            }
        }
    }
    for (j = 0; j < CAPSULE_PLAN_SUBSTEPS; j++) {
        for (k = 0; k < N; k++) {
            const real rise = (c[k + 1] - c[k]) / R(CAPSULE_PLAN_SUBSTEPS);
            p->start[k] = c[k] + R(j) * rise;
            p->end[k] = p->start[k] + rise;
            p->at[k] = its->t + R(k) * its->n->stage_s + R(j) * h;
        }
        capsule_plan_slopes(p->lanes, p->start, p->end, its->d, p->at, h, its->q, p->J);
        chain_rule(p, R(j) / R(CAPSULE_PLAN_SUBSTEPS), R(j + 1) / R(CAPSULE_PLAN_SUBSTEPS));
    }
}

/* Derivatives Z of the states by the command's rates, each of which moves the command by `step`. */
static void sensitivities(capsule_planner *p, real step)
{
    int i, j, k, m;
    memset(p->Z[0], 0, sizeof p->Z[0]);
    for (k = 0; k < N; k++) {
        for (i = 0; i < S; i++) {
            real *row = p->Z[k + 1][i];
            const real both = (p->by[i][S][k] + p->by[i][S + 1][k]) * step;
            for (j = 0; j < N; j++) {
                row[j] = j < k ? both : R(0);
            }
            for (m = 0; m < S; m++) {
                const real slope = p->by[i][m][k], *before = p->Z[k][m];
                for (j = 0; j < k; j++) {
                    row[j] += slope * before[j];
                }
            }
            row[k] = p->by[i][S + 1][k] * step;
        }
    }
}

/* The Gauss-Newton Hessian (its lower half) and the gradient of the cost by the rates over `unit`. */
static void quadratic(const task *its, capsule_planner *p, real unit)
{
    const real *scales = its->n->scales, r = unit / scales[2], q = unit / scales[3];
    real before = its->rate;
    int i, j, k;
    memset(p->H, 0, sizeof p->H);
    memset(p->f, 0, sizeof p->f);
    for (k = 1; k <= N; k++) {
        const real px = (k == N ? scales[4] : R(1)) / square(scales[0]), pv = R(1) / square(scales[1]);
        const real ex = px * (p->best.path[k][0] - p->targets[0][k]);
        const real ev = pv * (p->best.path[k][1] - p->targets[1][k]);
        for (i = 0; i < k; i++) {
            const real *zx = p->Z[k][0], *zv = p->Z[k][1], wx = px * zx[i], wv = pv * zv[i];
            p->f[i] += ex * zx[i] + ev * zv[i];
            for (j = 0; j <= i; j++) {
                p->H[i][j] += wx * zx[j] + wv * zv[j];
            }
        }
    }
    for (k = 0; k < N; k++) {
        const real now = (p->best.commands[k + 1] - p->best.commands[k]) / its->n->stage_s;
        p->f[k] += r * (now - p->targets[2][k]) / scales[2] + q * (now - before) / scales[3];
        p->H[k][k] += r * r + q * q;
        if (k > 0) {
            p->f[k - 1] -= q * (now - before) / scales[3];
            p->H[k - 1][k - 1] += q * q;
            p->H[k][k - 1] -= q * q;
        }
        before = now;
    }
    for (i = 0; i < 3; i++) {
        p->H[N + i][N + i] = EXCESS * its->n->penalty[i];
        p->f[N + i] = its->n->penalty[i];
    }
}

/* Rows of |value|/bound - slack <= 1 for stages near a soft bound; their number. */
static int soft_rows(const task *its, capsule_planner *p, real step)
{
    int kind, k, j, m, count = 0;
    for (kind = 0; kind < 3; kind++) {
        const real bound = its->n->soft[kind];
        int near = 0;
        for (k = 1; k <= N; k++) {
            near = near || real_abs(bounded(p, &p->best, kind, k)) > NEAR * bound;
        }
        for (k = 1; near && k <= N; k++, count++) {
            const real value = bounded(p, &p->best, kind, k), side = (value >= 0 ? R(1) : R(-1)) / bound;
            real *row = p->rows[count];
            memset(row, 0, sizeof p->rows[count]);
            for (j = 0; j < k; j++) {
                real slope = kind == 0 ? step - p->Z[k][0][j] : p->Z[k][1][j];
                if (kind == 2) {
                    slope = 0;
                    for (m = 0; m < S; m++) {
                        slope += p->slopes[m][k] * p->Z[k][m][j];
                    }
                }
                row[j] = side * slope;
            }
            row[N + kind] = R(-1);
            p->upper[N + 3 + count] = R(1) - side * value;
        }
    }
    return count;
}

/* Bounds of the rates, and rows of acceleration and range while the plan is near them; the number of rows. */
static int hard_rows(const task *its, capsule_planner *p, real unit, int simple, int count)
{
    const real stage = its->n->stage_s, *hard = its->n->hard, *c = p->best.commands;
    const real low = hard[0], high = hard[1], most = hard[2], bend = hard[3], middle = R(0.5) * (low + high);
    const real turn = bend * its->n->tick_s;
    real before = its->rate;
    int k, j, bent = 0, close = 0;
    for (k = 0; k < N; k++) {
        const real rate = (c[k + 1] - c[k]) / stage;
        p->upper[k] = (most - rate) / unit;
        p->lower[k] = (-most - rate) / unit;
        if (k == 0) {
            p->upper[0] = greater(lesser(p->upper[0], (its->rate + turn - rate) / unit), R(0));
            p->lower[0] = lesser(greater(p->lower[0], (its->rate - turn - rate) / unit), R(0));
        } else if (real_abs(rate - before) > NEAR * bend * stage) {
            bent = 1;
        }
        before = rate;
        close = close || real_abs(c[k + 1] - middle) > NEAR * (high - middle);
    }
    for (k = 1; bent && k < N; k++, count++) {
        const real jump = (c[k + 1] - R(2) * c[k] + c[k - 1]) / stage;
        memset(p->rows[count], 0, sizeof p->rows[count]);
        p->rows[count][k] = 1;
        p->rows[count][k - 1] = R(-1);
        p->upper[simple + count] = (bend * stage - jump) / unit;
        p->lower[simple + count] = (-bend * stage - jump) / unit;
    }
    for (k = 0; close && k < N; k++, count++) {
        for (j = 0; j < CAPSULE_RATES; j++) {
            p->rows[count][j] = j <= k ? R(1) : R(0);
        }
        p->upper[simple + count] = (high - c[k + 1]) / (unit * stage);
        p->lower[simple + count] = (low - c[k + 1]) / (unit * stage);
    }
    return count;
}

/* Changes of the rates within the bounds near the plan, into p->y; whether there are. */
static int solve(const task *its, capsule_planner *p, real unit)
{
    const int soft = soft_rows(its, p, unit * its->n->stage_s), size = soft > 0 ? N + 3 : N;
    int k;
    for (k = N; k < size; k++) {
        p->upper[k] = FREE;
        p->lower[k] = 0;
    }
    for (k = 0; k < soft; k++) {
        p->lower[size + k] = -FREE;
    }
    return capsule_solved(p, size, hard_rows(its, p, unit, size, soft));
}

/* Follows the change as far as the cost falls; the gain. */
static real search(const task *its, capsule_planner *p, real unit)
{
    static const real shares[] = {R(1), R(0.4), R(0.1)};
    int i, k;
    for (i = 0; i < 3; i++) {
        real moved = 0;
        p->other.commands[0] = p->best.commands[0];
        for (k = 0; k < N; k++) {
            moved += p->y[k] * (unit * its->n->stage_s);
            p->other.commands[k + 1] = p->best.commands[k + 1] + shares[i] * moved;
        }
        memcpy(p->other.path[0], p->best.path[0], sizeof p->other.path[0]);
        roll(its, p, &p->other, 0);
        if (p->other.cost < p->best.cost) {
            const real gain = p->best.cost - p->other.cost;
            p->best = p->other;
            return gain;
        }
    }
    return 0;
}

/* The guess, or the plan that follows the reference by inverting the model if that costs less. */
static void begin(const task *its, capsule_planner *p, const real *state)
{
    memcpy(p->best.commands, p->guess, sizeof p->guess);
    memcpy(p->best.path[0], state, sizeof p->best.path[0]);
    memcpy(p->other.path[0], state, sizeof p->other.path[0]);
    p->other.commands[0] = p->guess[0];
    pursue(its, p, &p->other);
    roll(its, p, &p->best, 0);
    roll(its, p, &p->other, N);
    if (p->other.cost < p->best.cost || !isfinite(p->best.cost)) {
        p->best = p->other;
    }
}

static real largest(const real *values, int count)
{
    real most = 0;
    int k;
    for (k = 0; k < count; k++) {
        most = greater(real_abs(values[k]), most);
    }
    return most;
}

int capsule_planned(const capsule_numbers *n, capsule_planner *p, const real *state, real d, double now, real rate)
{
    const real unit = n->scales[2], bound = n->soft[2];
    task its;
    its.n = n;
    its.q = p->parameters;
    its.d = d;
    its.t = R(now);
    its.rate = rate;
    its.pressed = bound < FREE;
    begin(&its, p, state);
    if (!isfinite(p->best.cost)) {
        return -1;
    }
    while (p->steps < CAPSULE_ITERATIONS) {
        its.pressed = bound < FREE;
        linearise(&its, p);
        price(&its, p, &p->best);
        its.pressed = its.pressed && largest(p->forces, N + 1) > PRESSED * bound;
        sensitivities(p, unit * n->stage_s);
        quadratic(&its, p, unit);
        p->steps++;
        if (!solve(&its, p, unit)) {
            return p->steps == 1 ? -1 : 1;
        }
        if (!(search(&its, p, unit) > ENOUGH * (real_abs(p->best.cost) + LITTLE))) {
            return 1;
        }
    }
    return 0;
}
#else
typedef int capsule_no_planner;
#endif
