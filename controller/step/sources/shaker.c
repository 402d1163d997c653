/* The controller of an inner mass: a waveform for the mean speed out of the drive map, changed at the end of a cycle, in
   a slow loop. Averaged over the cycles progress p, speed s and the map's error b move as p' = s + b, s' = (u - s)/lag,
   b' = white noise. */
#include "internal.h"

#if CAPSULE_SHAKEN
#define N CAPSULE_STAGES
#define PARTS CAPSULE_PARTS
#define FAR R(1e3)        /* m or m/s, beyond which a number is invalid */
#define REGEAR R(0.2)     /* least change of the wanted speed, as a share, for a new choice of gear */
#define STILL R(1e-6)     /* m/s, below which the capsule is to rest */
#define REST_S 0.02       /* period of a cycle at rest */
#define CYCLES 4          /* that a tick may touch */
#define LONGEST_S R(1)    /* prediction of the filter */
#define GATE R(6)         /* standard deviations beyond which a reading is an outlier */
#define MOST_MISSED 10    /* outliers in a row, after which one is accepted */
#define ENOUGH R(1e-6)    /* m/s, change of the commands below which a plan is done */
#define SWEEPS 20

void capsule_shaker_begin(capsule_shaker *s, const capsule_numbers *n, double now, real position_m)
{
    s->time_s = now;
    s->missed = 0;
    s->learned_at = 0;
    memset(s->P, 0, sizeof s->P);
    s->z[0] = position_m;
    s->z[1] = 0;
    s->z[2] = 0;
    s->P[0][0] = n->reading_std_m * n->reading_std_m;
    s->P[2][2] = n->doubt * n->doubt;
    s->gear = -1;
    s->speed = 0;
    s->start_s = now - REST_S;
    s->seen_s = now;
    s->stamp_s = -(double)INFINITY;
    s->planned = 0;
    s->geared_for = 0;
    s->behind = -1;
    s->status = CAPSULE_OK;
}

/* The averaged motion over h: F z + g u. */
static void transition(const capsule_numbers *n, real h, real F[3][3], real *g)
{
    const real keep = real_exp(-h / n->lag_s), glide = n->lag_s * (R(1) - keep);
    memset(F, 0, 9 * sizeof(real));
    F[0][0] = 1;
    F[0][1] = glide;
    F[0][2] = h;
    F[1][1] = keep;
    F[2][2] = 1;
    g[0] = h - glide;
    g[1] = R(1) - keep;
    g[2] = 0;
}

/* A P A' */
static void moved(real A[3][3], real P[3][3])
{
    real half[3][3];
    int i, j;
    for (i = 0; i < 3; i++) {
        for (j = 0; j < 3; j++) {
            half[i][j] = A[i][0] * P[0][j] + A[i][1] * P[1][j] + A[i][2] * P[2][j];
        }
    }
    for (i = 0; i < 3; i++) {
        for (j = 0; j < 3; j++) {
            P[i][j] = half[i][0] * A[j][0] + half[i][1] * A[j][1] + half[i][2] * A[j][2];
        }
    }
}

static void predict(capsule_shaker *s, const capsule_numbers *n, double time_s)
{
    const real h = within(R(time_s - s->time_s), R(0), LONGEST_S), apart = real_abs(s->speed - s->learned_at);
    real F[3][3], g[3], z[3], q = n->wander + n->wander_share * real_abs(s->speed);
    int i;
    s->time_s = time_s > s->time_s ? time_s : s->time_s;
    if (h <= 0) {
        return;
    }
    if (apart > R(0.3e-3) + R(0.1) * real_abs(s->learned_at)) {
        s->P[2][2] += n->slope_doubt * apart * n->slope_doubt * apart;
        s->learned_at = s->speed;
    }
    transition(n, h, F, g);
    memcpy(z, s->z, sizeof z);
    for (i = 0; i < 3; i++) {
        s->z[i] = F[i][0] * z[0] + F[i][1] * z[1] + F[i][2] * z[2] + g[i] * s->speed;
    }
    moved(F, s->P);
    q *= q;
    s->P[0][0] += q * h * h * h / R(3);
    s->P[0][2] += R(0.5) * q * h * h;
    s->P[2][0] += R(0.5) * q * h * h;
    s->P[2][2] += q * h;
}

static void correct(capsule_shaker *s, const capsule_numbers *n, real position_m)
{
    const real noise = n->reading_std_m * n->reading_std_m + n->ripple_m * n->ripple_m, error = position_m - s->z[0];
    real S = s->P[0][0] + noise, gain[3], rest[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    int i, j;
    if (error * error > GATE * GATE * S && s->missed < MOST_MISSED) {
        s->missed++;
        return;
    }
    if (s->missed >= MOST_MISSED) {
        s->P[0][0] += error * error;
        S += error * error;
    }
    s->missed = 0;
    for (i = 0; i < 3; i++) {
        gain[i] = s->P[i][0] / S;
        s->z[i] += gain[i] * error;
        rest[i][0] -= gain[i];
    }
    moved(rest, s->P);
    for (i = 0; i < 3; i++) {
        for (j = 0; j < 3; j++) {
            s->P[i][j] += gain[i] * gain[j] * noise;
        }
    }
}

/* The fastest speed of a gear, signed. */
static real fastest(const capsule_numbers *n, int gear)
{
    return n->wave_speed[(int)n->gear_first[gear + 1] - 1];
}

static int reaches(const capsule_numbers *n, int gear, real speed)
{
    return speed * fastest(n, gear) > 0 && real_abs(speed) <= real_abs(fastest(n, gear));
}

/* The gear whose home speed is nearest by ratio among those that reach `speed`; -1 without any. */
static int nearest(const capsule_numbers *n, real speed)
{
    real best = R(INFINITY);
    int k, found = -1;
    for (k = 0; k < CAPSULE_GEARS; k++) {
        const real ratio = speed / n->gear_home[k], off = ratio > 1 ? ratio : R(1) / ratio;
        if (reaches(n, k, speed) && off < best) {
            best = off;
            found = k;
        }
    }
    return found;
}

/* Levels of a gear's waveform for `speed`: between two of its strengths; below its range at down to half the least. */
static void shape(capsule_shaker *s, const capsule_numbers *n, int gear, real speed)
{
    const int first = (int)n->gear_first[gear], last = (int)n->gear_first[gear + 1] - 1;
    const real size = real_abs(speed), least = real_abs(n->wave_speed[first]);
    int at = first, i;
    while (at < last && real_abs(n->wave_speed[at]) < size) {
        at++;
    }
    for (i = 0; i < PARTS; i++) {
        const real *level = &n->wave_level[i];
        if (size < least) {
            s->level[i] = within(level[first * PARTS] * (R(0.5) + R(0.5) * size / least), R(0), R(1));
        } else if (at == first || real_abs(n->wave_speed[at]) < size) {
            s->level[i] = level[at * PARTS];
        } else {
            const real low = real_abs(n->wave_speed[at - 1]);
            const real share = (size - low) / (real_abs(n->wave_speed[at]) - low);
            s->level[i] = (R(1) - share) * level[(at - 1) * PARTS] + share * level[at * PARTS];
        }
    }
}

/* Changes to `gear` at `speed`; each gear has its own bias. */
static void take(capsule_shaker *s, const capsule_numbers *n, int gear, real speed, int status)
{
    if (s->gear != gear) {
        const real doubt = n->doubt + n->doubt_share * real_abs(speed);
        int i;
        if (s->gear >= 0) {
            s->bias[s->gear] = s->z[2];
        }
        s->z[2] = gear >= 0 ? s->bias[gear] : R(0);
        s->learned_at = speed;
        for (i = 0; i < 3; i++) {
            s->P[2][i] = 0;
            s->P[i][2] = 0;
        }
        s->P[2][2] = doubt * doubt;
    }
    if (gear >= 0) {
        shape(s, n, gear, speed);
    }
    s->gear = gear;
    s->speed = speed;
    s->status = status;
}

/* The waveform for `speed`, in `gear` if that reaches it, else in the nearest that does, else the fastest that way. */
static void choose(capsule_shaker *s, const capsule_numbers *n, real speed, int gear, int bounded)
{
    real most = 0;
    int k, found = gear >= 0 && reaches(n, gear, speed) ? gear : nearest(n, speed);
    if (real_abs(speed) < STILL) {
        take(s, n, -1, R(0), bounded ? CAPSULE_LIMITED : CAPSULE_OK);
        return;
    }
    if (found >= 0) {
        take(s, n, found, speed, bounded ? CAPSULE_LIMITED : CAPSULE_OK);
        return;
    }
    for (k = 0; k < CAPSULE_GEARS; k++) {
        if (fastest(n, k) * speed > 0 && real_abs(fastest(n, k)) > real_abs(most)) {
            most = fastest(n, k);
            found = k;
        }
    }
    take(s, n, found, most, CAPSULE_LIMITED);
}

/* The first of the mean speeds that track best within [low, high]: least squares of progress, speed and change. */
static real planned(capsule_shaker *s, const capsule_numbers *n, const capsule_in *in, real shift, real low, real high)
{
    real wanted[2 * N], slope[N], gradient[N], u[N], largest = R(INFINITY);
    int i, j, sweep, inside = 1;
    for (i = 0; i < 2 * N; i++) {
        const real *by = &n->mpc_free[3 * i];
        wanted[i] = (i < N ? in->position_m[i + 1] - shift : in->speed_m_s[i - N + 1]) * n->mpc_scale[i];
        wanted[i] -= by[0] * s->z[0] + by[1] * s->z[1] + by[2] * s->z[2];
    }
    for (j = 0; j < N; j++) {
        gradient[j] = j == 0 ? n->mpc_last * s->planned : R(0);
        for (i = 0; i < 2 * N; i++) {
            gradient[j] += n->mpc_forced[i * N + j] * wanted[i];
        }
    }
    for (i = 0; i < N; i++) {
        u[i] = 0;
        for (j = 0; j < N; j++) {
            u[i] += n->mpc_inverse[i * N + j] * gradient[j];
        }
        inside = inside && u[i] >= low && u[i] <= high;
    }
    if (inside) {
        return u[0];
    }
    for (i = 0; i < N; i++) {
        u[i] = within(u[i], low, high);
    }
    for (i = 0; i < N; i++) {
        slope[i] = gradient[i];
        for (j = 0; j < N; j++) {
            slope[i] -= n->mpc_hessian[i * N + j] * u[j];
        }
    }
    for (sweep = 0; sweep < SWEEPS && largest >= ENOUGH; sweep++) {
        largest = 0;
        for (j = 0; j < N; j++) {
            const real to = within(u[j] + slope[j] / n->mpc_hessian[j * N + j], low, high), step = to - u[j];
            u[j] = to;
            for (i = 0; i < N; i++) {
                slope[i] -= n->mpc_hessian[j * N + i] * step;
            }
            largest = real_abs(step) > largest ? real_abs(step) : largest;
        }
    }
    return u[0];
}

/* The mean speed to command now. */
static real wished(capsule_shaker *s, const capsule_numbers *n, const capsule_in *in)
{
    const real wanted = in->speed_m_s[0];
    real missing, share, most;
    if (n->feedback <= 0) {
        return wanted;
    }
    predict(s, n, in->time_s);
    missing = in->position_m[0] - s->z[0];
    if (real_abs(wanted) < STILL && real_abs(missing) < n->near_m) {
        return R(0);
    }
    s->behind = real_abs(missing) > n->near_m && s->behind != 0;
    share = (s->behind != 0 ? n->catch_up_stopped : n->catch_up) * real_abs(wanted);
    most = n->catch_up_s * (real_abs(wanted) < STILL && share < R(0.5e-3) ? R(0.5e-3) : share);
    return planned(s, n, in, missing - within(missing, -most, most), wanted > 0 ? R(0) : n->reach_low,
                   wanted < 0 ? R(0) : n->reach_high);
}

/* Chooses the next cycle's waveform. */
static void next_cycle(capsule_shaker *s, const capsule_numbers *n, const capsule_in *in)
{
    const real wanted = in->speed_m_s[0];
    int k, gear = s->gear, sound = 1;
    for (k = 0; k <= N; k++) {
        sound = sound && real_abs(in->position_m[k]) < FAR && real_abs(in->speed_m_s[k]) < FAR;
    }
    if (!sound) {
        take(s, n, -1, R(0), CAPSULE_FAILED);
    } else if (in->time_s - s->seen_s > (double)n->blind_s && n->feedback > 0) {
        take(s, n, -1, R(0), CAPSULE_LOST);
    } else {
        s->planned = wished(s, n, in);
        if (real_abs(wanted - s->geared_for) > REGEAR * real_abs(s->geared_for)) {
            s->geared_for = wanted;
            gear = nearest(n, wanted);
        }
        choose(s, n, s->planned, gear, !(n->reach_low < s->planned && s->planned < n->reach_high));
    }
}

/* Mean level of the cycle between two shares of it. */
static real mean_level(const capsule_shaker *s, const capsule_numbers *n, real from, real to)
{
    const real *edge = n->gear_edge;
    real total = 0;
    int i;
    if (s->gear < 0) {
        return R(0);
    }
    edge += s->gear * (PARTS + 1);
    for (i = 0; i < PARTS; i++) {
        const real low = edge[i] > from ? edge[i] : from, high = edge[i + 1] < to ? edge[i + 1] : to;
        total += high > low ? s->level[i] * (high - low) : R(0);
    }
    return to > from ? total / (to - from) : R(0);
}

real capsule_shake(capsule_shaker *s, const capsule_numbers *n, const capsule_belief *b, const capsule_in *in,
                   capsule_out *out)
{
    const double now = in->time_s, tick = (double)n->tick_s, end = now + tick;
    double at = now;
    real total = 0;
    int k;
    if (!b->lost && real_abs(b->state[0]) < FAR && b->time_s >= s->stamp_s + (double)n->sample_s
        && b->time_s <= end) {
        s->stamp_s = b->time_s;
        s->seen_s = now;
        predict(s, n, b->time_s < now ? b->time_s : now);
        correct(s, n, b->state[0]);
    }
    for (k = 0; k < CYCLES && at < end - 1e-12; k++) {
        const double period = s->gear < 0 ? REST_S : (double)n->gear_period[s->gear], stop = s->start_s + period;
        if (at >= stop - 1e-9) {
            s->start_s = at - stop < tick ? stop : at;
            next_cycle(s, n, in);
        } else {
            const double until = end < stop ? end : stop;
            const real from = R((at - s->start_s) / period), to = R((until - s->start_s) / period);
            total += mean_level(s, n, from > 0 ? from : R(0), to < 1 ? to : R(1)) * R(until - at);
            at = until;
        }
    }
    out->status = s->status == CAPSULE_LIMITED ? CAPSULE_LIMITED : CAPSULE_OK;
    return s->status == CAPSULE_FAILED || s->status == CAPSULE_LOST ? R(NAN) : within(total / n->tick_s, R(0), R(1));
}
#else
typedef int capsule_no_shaker;
#endif
