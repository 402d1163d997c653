/* The control model's functions, generated into model.c. `q`: its parameters; `d`: force along +x that it lacks, N. */
#ifndef CAPSULE_MODEL_H
#define CAPSULE_MODEL_H

#include "elementary.h"

/* The loop that follows has no dependence from one turn to the next. */
#if defined(__GNUC__) && !defined(__clang__)
#define CAPSULE_LANES _Pragma("GCC ivdep")
#else
#define CAPSULE_LANES
#endif

/* All particles a sub-step of h s further from t, the command from c0 to c1; `own`: their own parameters. */
void capsule_particles(real (*restrict x)[CAPSULE_PARTICLES], const real *restrict d,
                       real (*restrict own)[CAPSULE_PARTICLES], const real *restrict q,
                       real c0, real c1, real t, real h);
/* The localisation's reading of each particle, where it is not the position. */
void capsule_shown(real (*restrict x)[CAPSULE_PARTICLES], real t, const real *restrict q, real *restrict shown);

/* With nearly exact friction: a sub-step, and the wall's force against +x in N. */
void capsule_sharp_step(real *x, real c0, real c1, real d, real t, real h, const real *q);
real capsule_sharp_wall(const real *x, real t, const real *q);

/* The drive's static force in N of a command (a gap), and the command for a force. */
real capsule_drive_force(real one, real x, real v, const real *q);
real capsule_drive_command(real one, real x, real v, const real *q);

#if CAPSULE_MPC
/* With the planner's smooth friction: a sub-step; a sub-step of all stages side by side with its derivatives
   J[(column, row)] by state, c0, c1 and d; the command that brings the capsule to `speed`; the wall's force at all
   ends of stages and its slopes by the state. */
void capsule_plan_step(real *x, real c0, real c1, real d, real t, real h, const real *q);
void capsule_plan_slopes(real (*restrict x)[CAPSULE_STAGES], const real *restrict c0, const real *restrict c1, real d,
                         const real *restrict t, real h, const real *restrict q, real (*restrict J)[CAPSULE_STAGES]);
real capsule_plan_pursuit(const real *x, real speed, real d, real t, const real *q);
void capsule_plan_walls(real (*restrict x)[CAPSULE_STAGES + 1], const real *restrict t, const real *restrict q,
                        real *restrict forces, real (*restrict slopes)[CAPSULE_STAGES + 1]);
#endif

#endif
