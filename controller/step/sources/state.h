/* The memory of a controller, of fixed size. Included by controller.h. */
#ifndef CAPSULE_STATE_H
#define CAPSULE_STATE_H

#define CAPSULE_DRAWS 8 /* redraws that a row of past readings may lag behind */

/* Estimator: particles, each a possible capsule with its own wall, friction level and force. */
typedef struct {
    const capsule_numbers *numbers;
    capsule_belief belief;
    uint32_t random[4];
    /* ticks since the start of the estimate and of the ring, at most CAPSULE_KEPT of them remembered */
    int count, newest, ticks_to_walk;
    /* the watch over accepted and refused positions */
    uint32_t refused, proven;
    int jumped;
    double accepted_at, last_s;
    real last_m;
    double time_s;
    real command, drive;   /* in force; that of the particles, with the offset */
    real surprise_mean;    /* running mean of the normalised innovations */
    int leader;            /* -1: none */
    int moved_some;        /* whether a periodic effect has been redrawn by a particle */
    real level_mean;
    real commands[CAPSULE_KEPT];                      /* ring, newest at `newest` */
    real currents[CAPSULE_KEPT];                      /* mean of a coil's current */
    real past[CAPSULE_KEPT][CAPSULE_PARTICLES];       /* each particle's sensor reading, as they stood in that tick */
    /* how often particles were drawn again, by then and up to now; in each of the last times, what became what */
    uint32_t drawn[CAPSULE_KEPT], draws;
    uint16_t parent[CAPSULE_DRAWS][CAPSULE_PARTICLES];
    real then[CAPSULE_PARTICLES];                     /* a row of `past` in the order of the particles now */
    real x[CAPSULE_STATES][CAPSULE_PARTICLES];
    real level[CAPSULE_PARTICLES], force[CAPSULE_PARTICLES], brisk[CAPSULE_PARTICLES], weight[CAPSULE_PARTICLES];
    real own[CAPSULE_VARIED][CAPSULE_PARTICLES];      /* friction parameter, then a periodic effect's size and phase */
    uint8_t moved[CAPSULE_PARTICLES];                 /* whether the particle has redrawn the periodic effect */
    real scratch[CAPSULE_PARTICLES];
} capsule_estimator;

typedef struct {
    real command, rate, aim;
} capsule_issued;

#define CAPSULE_RANKS (CAPSULE_SHAKEN ? 1 : CAPSULE_MPC + 2) /* an inner mass's, or MPC, feedforward, PID */

#if CAPSULE_MPC
#define CAPSULE_ROWS (5 * CAPSULE_STAGES)         /* soft and hard bounds of a plan, at most */
#define CAPSULE_RATES (CAPSULE_STAGES + 3)        /* unknowns of the quadratic program: rates and slacks */
#define CAPSULE_BOUNDS (CAPSULE_RATES + CAPSULE_ROWS)

typedef struct {
    real commands[CAPSULE_STAGES + 1];
    real path[CAPSULE_STAGES + 1][CAPSULE_STATES];
    real cost;
} capsule_plan;

/* The MPC: the plan in force and the planner's memory. */
typedef struct {
    double time_s;
    real command, rate;
    int resting, followable;
    int steps, iterations; /* of the last plan: SQP steps, iterations of their quadratic programs */
    real shifted[CAPSULE_STAGES + 1];
    real guess[CAPSULE_STAGES + 1];
    real targets[3][CAPSULE_STAGES + 1]; /* position, speed, command rate */
    capsule_plan best, other;
    real forces[CAPSULE_STAGES + 1], slopes[CAPSULE_STATES][CAPSULE_STAGES + 1];
    real ends[CAPSULE_STATES][CAPSULE_STAGES + 1], times[CAPSULE_STAGES + 1];
    real Z[CAPSULE_STAGES + 1][CAPSULE_STATES][CAPSULE_STAGES];
    real lanes[CAPSULE_STATES][CAPSULE_STAGES], J[CAPSULE_STATES * (CAPSULE_STATES + 3)][CAPSULE_STAGES];
    real start[CAPSULE_STAGES], end[CAPSULE_STAGES], at[CAPSULE_STAGES];
    real by[CAPSULE_STATES][CAPSULE_STATES + 2][CAPSULE_STAGES];
    real H[CAPSULE_RATES][CAPSULE_RATES], f[CAPSULE_RATES], y[CAPSULE_RATES];
    real rows[CAPSULE_ROWS][CAPSULE_RATES];
    real upper[CAPSULE_BOUNDS], lower[CAPSULE_BOUNDS];
    /* of the solver */
    real inverse[CAPSULE_RATES * (CAPSULE_RATES + 1) / 2], M[CAPSULE_ROWS * CAPSULE_RATES], Mu[CAPSULE_ROWS];
    real v[CAPSULE_RATES], scaling[CAPSULE_BOUNDS], u[CAPSULE_RATES], before[CAPSULE_RATES];
    real lam[CAPSULE_RATES + 1], star[CAPSULE_RATES + 1], D[CAPSULE_RATES + 1];
    real xldl[CAPSULE_RATES + 1], zldl[CAPSULE_RATES + 1];
    real L[(CAPSULE_RATES + 1) * (CAPSULE_RATES + 2) / 2];
    int sense[CAPSULE_BOUNDS], active[CAPSULE_RATES + 1], masked[CAPSULE_RATES];
    real parameters[CAPSULE_PARAMETERS];
} capsule_planner;
#endif

#if CAPSULE_SHAKEN
/* The controller of an inner mass: the filter of its mean motion, the cycle, the bias learned in each gear. */
typedef struct {
    double time_s, seen_s, stamp_s, start_s;  /* of the filter, of the newest estimate used, of the cycle's begin */
    real z[3], P[3][3], learned_at;           /* progress m, mean speed m/s, bias m/s, their covariance */
    int missed, gear, status, behind;         /* gear -1: at rest; behind -1: not known yet */
    real speed, planned, geared_for;          /* m/s, of the cycle on the model, of the plan, of the gear's choice */
    real level[CAPSULE_PARTS];
    real bias[CAPSULE_GEARS];
} capsule_shaker;
#endif

/* The controllers, their fallback chain and the command in force. Times are in s since its begin. */
typedef struct {
    const capsule_numbers *numbers;
    double now_s, elapsed_s;
    real tick_s;
    capsule_issued issued;
    int active, reason, halted, broken;
    double bad_until, rest_since, limited_since, stopped_at;
    real unfollowed_s, stop_from;
    /* which ranks are suspended until when, for how long the next time, and since when they work */
    double closed_until[CAPSULE_RANKS], good_since[CAPSULE_RANKS];
    real wait[CAPSULE_RANKS];
    int banned[CAPSULE_RANKS];
    double blend_since;
    real blend_step, blend_left;
    /* swings of the capsule about the reference */
    int swings, growing, peaks_seen;
    double swing_far_at, peak_at;
    real swing_side, peaks[4], peak_side;
    /* feedforward */
    int returning;
    real gain, most_m_s, continued; /* continued: the command in force without the step that fades */
    /* PID */
    real pid_sum, pid_start;
#if CAPSULE_MPC
    capsule_planner planner;
#endif
#if CAPSULE_SHAKEN
    capsule_shaker shaker;
#endif
} capsule_controller;

struct capsule_state {
    capsule_estimator estimator;
    capsule_controller controller;
};

#endif
