/* The estimator: a particle filter with the control model as its process, for late, wrong and missing readings. */
#include "model.h"
#include "random.h"

#define P CAPSULE_PARTICLES
#define RENEWED R(0.5)         /* share of effective particles below which all are resampled */
#define REDRAWN_1_S R(0.3)     /* rate at which a particle redraws whether its level is brisk */
#define FOLLOWS R(3)           /* standard deviations of the carriage beyond which a report is an offset */
#define APART R(5.656854249492381)
#define RECENT R(0.1)          /* share of the newest innovation in their running mean */
#define SURPRISE R(0.7)        /* mean innovation beyond which a push is assumed */
#define ASTRAY R(1.5)          /* beyond which model and capsule move apart */
#define LANES 8                /* partial sums, so that a sum is vector code and the same everywhere */

/* `sum w v`; values of zero weight are ignored. */
static real weighted(const real *restrict w, const real *restrict v)
{
    real part[LANES] = {0}, total = 0;
    int k, i;
    for (k = 0; k + LANES <= P; k += LANES) {
        for (i = 0; i < LANES; i++) {
            part[i] += w[k + i] > 0 ? w[k + i] * v[k + i] : R(0);
        }
    }
    for (; k < P; k++) {
        part[0] += w[k] > 0 ? w[k] * v[k] : R(0);
    }
    for (i = 0; i < LANES; i++) {
        total += part[i];
    }
    return total;
}

/* `sum w (v - mean)^2` */
static real variance_of(const real *restrict w, const real *restrict v, real mean)
{
    real part[LANES] = {0}, total = 0;
    int k, i;
    for (k = 0; k + LANES <= P; k += LANES) {
        for (i = 0; i < LANES; i++) {
            const real off = v[k + i] - mean;
            part[i] += w[k + i] > 0 ? w[k + i] * off * off : R(0);
        }
    }
    for (; k < P; k++) {
        part[0] += w[k] > 0 ? w[k] * (v[k] - mean) * (v[k] - mean) : R(0);
    }
    for (i = 0; i < LANES; i++) {
        total += part[i];
    }
    return total;
}

static int place_of(const capsule_estimator *e, int back)
{
    const int place = e->newest - back;
    return place < 0 ? place + CAPSULE_KEPT : place;
}

static void even_weights(capsule_estimator *e)
{
    int k;
    for (k = 0; k < P; k++) {
        e->weight[k] = R(1) / R(P);
    }
}

/* The sensor's readings now, with the drive at `command`. */
static void remember(capsule_estimator *e, double now, real command)
{
    e->time_s = now;
    e->drive = command;
    e->drawn[e->newest] = e->draws;
#if CAPSULE_PLAIN
    memcpy(e->past[e->newest], e->x[0], sizeof e->past[0]);
#else
    capsule_shown(e->x, R(now), e->numbers->parameters, e->past[e->newest]);
#endif
#if CAPSULE_CURRENT_STATE >= 0
    e->currents[e->newest] = weighted(e->weight, e->x[CAPSULE_CURRENT_STATE]);
#endif
}

/* At rest at `position_m` under the command in force. */
static void begin(capsule_estimator *e, real position_m, double now)
{
    const capsule_numbers *n = e->numbers;
    int i, k;
    for (i = 0; i < CAPSULE_STATES; i++) {
        const real at = n->start[i] + n->start_by_position[i] * position_m + n->start_by_command[i] * e->command;
        for (k = 0; k < P; k++) {
            e->x[i][k] = n->start_std[i] > 0 ? at + n->start_std[i] * capsule_normal(e->random) : at;
        }
    }
    for (k = 0; k < P; k++) {
        e->level[k] = within(n->level_std * capsule_normal(e->random), n->level_low, n->level_high);
        e->force[k] = n->force_std_N * capsule_normal(e->random);
        e->brisk[k] = capsule_uniform(e->random) < R(0.5) ? R(1) : R(0);
#if CAPSULE_PERIODIC
        e->own[1][k] = n->parameters[CAPSULE_PERIODIC_SIZE];
        e->own[2][k] = n->parameters[CAPSULE_PERIODIC_PHASE];
        e->moved[k] = 0;
#endif
    }
    e->moved_some = 0;
    e->level_mean = 0;
    even_weights(e);
    e->newest = 0;
    e->ticks_to_walk = CAPSULE_WALK_TICKS > 1 ? CAPSULE_WALK_TICKS / 2 : 1;
    e->surprise_mean = 0;
    e->leader = -1;
    remember(e, now, e->command);
}

static void start(capsule_estimator *e, real position_m, double now)
{
    begin(e, position_m, now);
    e->commands[0] = e->command;
    e->count = 1;
    e->refused = 0;
    e->proven = 0;
    e->accepted_at = now;
    e->jumped = 0;
}

#if CAPSULE_PERIODIC
#define WALK_RAD R(0.3)       /* walk of the phase per root second, of those redrawn */
#define ABSENT R(0.2)         /* share of the redrawn ones without the effect */
#define LEVEL_STD R(0.05)     /* of the friction level of those redrawn, about its mean */
#define MEAN_S R(3)           /* over which that mean is taken */
#define PI R(3.14159265358979323846)

/* Where a periodic effect of the gut is, and how large: particles walk, and redraw once it is doubted. */
static void walk_periodic(capsule_estimator *e, real passed, int surprised)
{
    const real share = (surprised ? R(1) : R(0.3)) * passed;
    int k;
    e->level_mean += passed / MEAN_S * (weighted(e->weight, e->level) - e->level_mean);
    if (!surprised && !e->moved_some) {
        return;
    }
    for (k = 0; k < P; k++) {
        if (e->moved[k] != 0) {
            e->own[2][k] += WALK_RAD * real_sqrt(passed) * capsule_normal(e->random);
        }
        if (capsule_uniform(e->random) < share) {
            e->moved[k] = 1;
            e->moved_some = 1;
            e->own[1][k] = capsule_uniform(e->random) < ABSENT ? R(0) : e->numbers->parameters[CAPSULE_PERIODIC_SIZE];
            e->own[2][k] = PI * (R(2) * capsule_uniform(e->random) - R(1));
            e->level[k] = e->level_mean + LEVEL_STD * capsule_normal(e->random);
        }
    }
}

/* Size and phase of all particles by their weights: the mean of `size exp(i phase)`. */
static void mean_periodic(const capsule_estimator *e, real *parameters)
{
    const real own = e->numbers->parameters[CAPSULE_PERIODIC_SIZE], sign = own < 0 ? R(-1) : R(1);
    real along = 0, across = 0;
    int k;
    if (!e->moved_some) {
        return;
    }
    for (k = 0; k < P; k++) {
        along += e->weight[k] * e->own[1][k] * real_cos(e->own[2][k]);
        across += e->weight[k] * e->own[1][k] * real_sin(e->own[2][k]);
    }
    parameters[CAPSULE_PERIODIC_SIZE] = real_sqrt(along * along + across * across) * sign;
    parameters[CAPSULE_PERIODIC_PHASE] = real_atan2(across * sign, along * sign);
}
#endif

/* Random walks of position, level and force of each particle. */
static void walk(capsule_estimator *e)
{
    const capsule_numbers *n = e->numbers;
    const real passed = R(CAPSULE_WALK_TICKS) * n->tick_s, root = real_sqrt(passed), size = real_abs(e->surprise_mean);
    const real place = root * (size > ASTRAY ? n->slip_wander_m : n->position_wander_m);
    const real force = root * (size > SURPRISE ? n->push_wander_N : n->force_wander_N);
    const real calm = root * n->level_wander, brisk = root * n->brisk_level_wander, redrawn = REDRAWN_1_S * passed;
    int k;
    for (k = 0; k < P; k++) {
        const real chance = capsule_uniform(e->random);
        if (chance < redrawn) {
            e->brisk[k] = chance < R(0.5) * redrawn ? R(1) : R(0);
        }
        e->x[0][k] += place * capsule_normal(e->random);
        e->level[k] = within(e->level[k] + (e->brisk[k] > 0 ? brisk : calm) * capsule_normal(e->random), n->level_low,
                             n->level_high);
        e->force[k] += force * capsule_normal(e->random);
    }
#if CAPSULE_PERIODIC
    walk_periodic(e, passed, size > SURPRISE && n->push_wander_N > n->force_wander_N);
#endif
}

/* A tick, to `now`, at the end of which the drive is at `command`. */
static void predict(capsule_estimator *e, double now, real command)
{
    const capsule_numbers *n = e->numbers;
    const real before = CAPSULE_ANCHORED ? e->drive : command, h = n->tick_s / R(CAPSULE_SUBSTEPS);
    const real rise = (command - before) / R(CAPSULE_SUBSTEPS);
    int j, k;
    for (k = 0; k < P; k++) {
        e->own[0][k] = n->level_middle * (R(1) + e->level[k]);
    }
    for (j = 0; j < CAPSULE_SUBSTEPS; j++) {
        const real c0 = before + R(j) * rise;
        capsule_particles(e->x, e->force, e->own, n->parameters, c0, c0 + rise, R(e->time_s) + R(j) * h, h);
    }
    e->newest = e->newest + 1 == CAPSULE_KEPT ? 0 : e->newest + 1;
    if (--e->ticks_to_walk <= 0) {
        e->ticks_to_walk = CAPSULE_WALK_TICKS;
        walk(e);
    }
    remember(e, now, command);
}

static void take_chosen(capsule_estimator *e, real *row, const uint16_t *chosen)
{
    int k;
    for (k = 0; k < P; k++) {
        e->scratch[k] = row[chosen[k]];
    }
    memcpy(row, e->scratch, sizeof e->scratch);
}

/* Where a redraw is written down, in place of the oldest one, which the rows before it catch up with. */
static uint16_t *next_draw(capsule_estimator *e)
{
    uint16_t *parent = e->parent[e->draws % CAPSULE_DRAWS];
    int i;
    for (i = 0; i < (e->count < CAPSULE_KEPT ? e->count : CAPSULE_KEPT); i++) {
        const int place = place_of(e, i);
        if (e->draws - e->drawn[place] >= CAPSULE_DRAWS) {
            take_chosen(e, e->past[place], parent);
            e->drawn[place]++;
        }
    }
    e->draws++;
    return parent;
}

/* The particles' readings `back` ticks ago. */
static const real *readings(capsule_estimator *e, int back)
{
    const int place = place_of(e, back);
    uint32_t draw;
    if (e->drawn[place] == e->draws) {
        return e->past[place];
    }
    memcpy(e->then, e->past[place], sizeof e->then);
    for (draw = e->drawn[place]; draw != e->draws; draw++) {
        take_chosen(e, e->then, e->parent[draw % CAPSULE_DRAWS]);
    }
    return e->then;
}

/* Systematic resampling: particles of little weight become copies of heavier ones. */
static void renew(capsule_estimator *e)
{
    const real share = capsule_uniform(e->random);
    uint16_t *chosen = next_draw(e);
    real total = e->weight[0];
    int k = 0, i, leader = -1;
    for (i = 0; i < P; i++) {
        while ((R(i) + share) / R(P) > total && k < P - 1) {
            k++;
            total += e->weight[k];
        }
        chosen[i] = (uint16_t)k;
        if (k == e->leader && leader < 0) {
            leader = i;
        }
    }
    for (i = 0; i < CAPSULE_STATES; i++) {
        take_chosen(e, e->x[i], chosen);
    }
    take_chosen(e, e->level, chosen);
    take_chosen(e, e->force, chosen);
    take_chosen(e, e->brisk, chosen);
#if CAPSULE_PERIODIC
    take_chosen(e, e->own[1], chosen);
    take_chosen(e, e->own[2], chosen);
    for (i = 0; i < P; i++) {
        e->scratch[i] = R(e->moved[chosen[i]]);
    }
    e->moved_some = 0;
    for (i = 0; i < P; i++) {
        e->moved[i] = e->scratch[i] > 0 ? 1u : 0u;
        e->moved_some = e->moved_some || e->moved[i] != 0;
    }
#endif
    even_weights(e);
    e->leader = leader;
}

/* Multiplies the weights by the likelihood of `measured`; the effective sample size. */
static real weigh(capsule_estimator *e, const real *then, real measured, real variance)
{
    real least = R(INFINITY), total = 0, square = 0;
    int k;
    for (k = 0; k < P; k++) {
        const real off = (measured - then[k]) * (measured - then[k]);
        e->scratch[k] = off;
        if (e->weight[k] > 0 && off < least) {
            least = off;
        }
    }
    CAPSULE_LANES
    for (k = 0; k < P; k++) {
        const real off = e->scratch[k] < R(INFINITY) ? e->scratch[k] : least;
        const real likely = e->weight[k] * real_exp(R(0.5) * (least - off) / variance);
        e->weight[k] = ((e->weight[k] > 0) & (e->scratch[k] < R(INFINITY))) != 0 ? likely : R(0);
    }
    for (k = 0; k < P; k++) {
        total += e->weight[k];
    }
    for (k = 0; k < P; k++) {
        e->weight[k] = total > 0 ? e->weight[k] / total : R(1) / R(P);
        square += e->weight[k] * e->weight[k];
    }
    return R(1) / square;
}

/* Uses a position true `back` ticks ago; its signed normalised innovation, beyond the gate if refused. */
static real see_position(capsule_estimator *e, int back, real value)
{
    const capsule_numbers *n = e->numbers;
    const real *then = readings(e, back);
    const real variance = n->position_std_m * n->position_std_m, mean = weighted(e->weight, then);
    const real size = (value - mean) / real_sqrt(variance_of(e->weight, then, mean) + variance);
    if (real_abs(size) <= n->gate) {
        e->surprise_mean += RECENT * (size - e->surprise_mean);
        if (weigh(e, then, value, variance) < RENEWED * R(P)) {
            renew(e);
        }
    }
    return size;
}

/* The capsule was at `position_m` `back` ticks ago: positions since then shift, the rest stays. */
static void shift(capsule_estimator *e, int back, real position_m)
{
    const real off = position_m - weighted(e->weight, readings(e, back));
    int i, k;
    for (k = 0; k < P; k++) {
        e->x[0][k] += off + e->numbers->position_std_m * capsule_normal(e->random);
    }
    for (i = 0; i < CAPSULE_KEPT; i++) {
        for (k = 0; k < P; k++) {
            e->past[i][k] += off;
        }
    }
}

/* A position that was refused: the estimate follows after a few, or starts again after many. */
static void refuse(capsule_estimator *e, real position_m, double stamp_s, int back, double now)
{
    const capsule_numbers *n = e->numbers;
    const real most = n->slip_m_s * R(fabs(stamp_s - e->last_s)) + APART * n->position_std_m;
    e->belief.outliers++;
    e->refused++;
    e->jumped = e->jumped || !(real_abs(position_m - e->last_m) <= most);
    e->last_m = position_m;
    e->last_s = stamp_s;
    if (!e->jumped && R(e->refused) >= n->slips_in_a_row) {
        e->belief.followed++;
        e->refused = 0;
        e->accepted_at = now;
        shift(e, back, position_m);
    } else if (R(e->refused) >= n->outliers_in_a_row) {
        e->belief.restarts++;
        start(e, position_m, now);
    }
}

static void accept(capsule_estimator *e, real position_m, double stamp_s, double now, real size)
{
    capsule_belief *b = &e->belief;
    b->accepted++;
    e->refused = 0;
    e->accepted_at = now;
    e->jumped = 0;
    e->proven++;
    e->last_m = position_m;
    e->last_s = stamp_s;
    if (b->innovations < CAPSULE_READINGS) {
        b->innovation[b->innovations++] = size;
    }
}

#if CAPSULE_CURRENT_STATE >= 0
/* A reading of the coil's current shifts every particle by its difference from their mean then. */
static void see_current(capsule_estimator *e, int back, real value)
{
    const real off = value - e->currents[place_of(e, back)];
    int k;
    for (k = 0; k < P; k++) {
        e->x[CAPSULE_CURRENT_STATE][k] += off;
    }
    for (k = 0; k < CAPSULE_KEPT; k++) {
        e->currents[k] += off;
    }
}
#endif

static void take(capsule_estimator *e, const capsule_reading *m, double now)
{
    const capsule_numbers *n = e->numbers;
    const int position = m->channel == CAPSULE_POSITION;
    const int current = m->channel == CAPSULE_CURRENT && CAPSULE_CURRENT_STATE >= 0;
    double back;
    if (!isfinite(m->value) || !isfinite(m->stamp_s)
        || !(position || current || m->channel == CAPSULE_COMMANDED)) {
        e->belief.unusable++;
        return;
    }
    if (position && e->count == 0) {
        start(e, m->value, now);
        return;
    }
    back = floor((now - m->stamp_s + (position ? (double)n->delay_s : 0.0)) / (double)n->tick_s + 0.5);
    if (!(back >= 0.0 && back < (double)e->count)) {
        e->belief.unusable++;
    } else if (position) {
        const real size = see_position(e, (int)back, m->value);
        e->belief.surprise = size;
        if (real_abs(size) <= n->gate) {
            accept(e, m->value, m->stamp_s, now, size);
        } else {
            refuse(e, m->value, m->stamp_s, (int)back, now);
        }
    } else if (current) {
#if CAPSULE_CURRENT_STATE >= 0
        see_current(e, (int)back, m->value);
#endif
    } else {
        const real off = m->value - e->commands[place_of(e, (int)back)];
        e->belief.offset = real_abs(off) > FOLLOWS * n->carriage_std_m ? off : R(0);
    }
}

/* The leading particle: the same as long as its position, level and wall are near the mean, else the nearest. */
static void lead(capsule_estimator *e, const real *mean, const real *std, real level)
{
    const int w = CAPSULE_WALL_STATE;
    const real spread = variance_of(e->weight, e->level, level);
    real best = R(INFINITY);
    int k = e->leader;
    if (k >= 0 && real_abs(e->x[0][k] - mean[0]) <= R(1.5) * std[0]
        && real_abs(e->x[w][k] - mean[w]) <= R(2.5) * std[w]
        && (e->level[k] - level) * (e->level[k] - level) <= R(2.25) * spread) {
        return;
    }
    e->leader = 0;
    for (k = 0; k < P; k++) {
        const real x = e->x[0][k] - mean[0], l = e->level[k] - level, u = e->x[w][k] - mean[w];
        const real off = x * x / (std[0] * std[0] + REAL_LEAST) + l * l / (spread + REAL_LEAST)
            + u * u / (std[w] * std[w] + REAL_LEAST);
        if (e->weight[k] > 0 && off < best) {
            best = off;
            e->leader = k;
        }
    }
}

/* What the particles say now; whether it is numbers. */
static int survey(capsule_estimator *e, double now)
{
    static const int modes[] = CAPSULE_MODES;
    const capsule_numbers *n = e->numbers;
    capsule_belief *b = &e->belief;
    real mean[CAPSULE_STATES], force = weighted(e->weight, e->force), sum, scale;
    int i;
    b->level = weighted(e->weight, e->level);
    sum = b->level + force;
    for (i = 0; i < CAPSULE_STATES; i++) {
        mean[i] = weighted(e->weight, e->x[i]);
        b->std[i] = real_sqrt(variance_of(e->weight, e->x[i], mean[i]));
        sum += mean[i] + b->std[i];
    }
    if (!isfinite(sum)) {
        return 0;
    }
    lead(e, mean, b->std, b->level);
    for (i = 0; i < CAPSULE_STATES; i++) {
        b->state[i] = i == 0 ? mean[0] : e->x[i][e->leader];
    }
    for (i = 0; modes[i] >= 0; i++) {
        b->std[modes[i]] = 0;
    }
    memcpy(b->parameters, n->parameters, sizeof b->parameters);
#if CAPSULE_PERIODIC
    mean_periodic(e, b->parameters);
#endif
    b->force_N = force;
    b->lacking_N = force + capsule_sharp_wall(b->state, R(now), b->parameters);
    scale = R(1) + within(b->level, n->level_low, n->level_high);
    b->parameters[0] *= scale;
    b->lacking_N -= capsule_sharp_wall(b->state, R(now), b->parameters);
    return 1;
}

static void nothing_known(capsule_belief *b, double now)
{
    int i;
    b->time_s = now;
    for (i = 0; i < CAPSULE_STATES; i++) {
        b->state[i] = R(NAN);
        b->std[i] = R(NAN);
    }
    b->lacking_N = 0;
    b->force_N = 0;
    b->lost = 1;
    b->learned = 0;
}

void capsule_estimator_init(capsule_estimator *e, const capsule_numbers *numbers, double begin_s, real command)
{
    memset(e, 0, sizeof *e);
    e->numbers = numbers;
    e->command = command;
    e->accepted_at = -(double)INFINITY;
    e->last_m = R(NAN);
    e->last_s = (double)NAN;
    e->leader = -1;
    capsule_seed(e->random);
    nothing_known(&e->belief, begin_s);
    memcpy(e->belief.parameters, numbers->parameters, sizeof e->belief.parameters);
}

/* Puts the fresh readings in the order of their stamps, unreadable ones last. */
static int ordered(const capsule_in *in, capsule_reading *sorted)
{
    const int count = in->readings < 0 ? 0 : (in->readings > CAPSULE_READINGS ? CAPSULE_READINGS : in->readings);
    int i, j;
    for (i = 0; i < count; i++) {
        const capsule_reading m = in->reading[i];
        for (j = i; j > 0 && (m.stamp_s < sorted[j - 1].stamp_s
                              || (isnan(sorted[j - 1].stamp_s) && !isnan(m.stamp_s))); j--) {
            sorted[j] = sorted[j - 1];
        }
        sorted[j] = m;
    }
    return count;
}

void capsule_estimate(capsule_estimator *e, const capsule_in *in)
{
    const capsule_numbers *n = e->numbers;
    capsule_belief *b = &e->belief;
    capsule_reading reading[CAPSULE_READINGS];
    const double now = in->time_s;
    int i, count;
    e->command = isfinite(in->in_force) ? in->in_force : e->command;
    if (e->count > 0) {
        predict(e, now, e->command + b->offset);
        e->commands[e->newest] = e->command;
        e->count = e->count < CAPSULE_KEPT ? e->count + 1 : CAPSULE_KEPT;
    }
    b->innovations = 0;
    b->surprise = R(NAN);
    count = ordered(in, reading);
    for (i = 0; i < count; i++) {
        take(e, &reading[i], now);
    }
    if (e->count == 0 || !survey(e, now)) {
        b->restarts += e->count > 0 ? 1u : 0u;
        e->count = 0;
        nothing_known(b, now);
        return;
    }
    b->time_s = now;
    b->learned = 1;
    b->lost = now - e->accepted_at > (double)n->age_s || !(b->std[0] <= n->lost_std_m) || R(e->proven) < n->proof;
}
