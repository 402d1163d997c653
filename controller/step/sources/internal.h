/* What the parts of the controller know of each other. */
#ifndef CAPSULE_INTERNAL_H
#define CAPSULE_INTERNAL_H

#include "model.h"

/* What is known of the capsule when a command is limited. */
typedef struct {
    real position_m, speed_m_s, age_s, std_m, temperature_C;
    int lost;
} capsule_seen;

/* The command nearest to `wanted` that breaks no limit, dt s after `previous`; the limits that acted in `broken`. */
capsule_issued capsule_limited(const capsule_numbers *n, real wanted, capsule_issued previous, const capsule_seen *seen,
                               real dt, int *broken);

/* The feedforward's and the PID's command; NaN where something is not a number. */
real capsule_feedforward(capsule_controller *c, const capsule_belief *belief, const capsule_in *in);
real capsule_pid(capsule_controller *c, const capsule_belief *belief, const capsule_in *in);

#if CAPSULE_SHAKEN
/* The inner mass at rest at `position_m`; the biases stay. The level of a tick; NaN for none. */
void capsule_shaker_begin(capsule_shaker *s, const capsule_numbers *n, double now, real position_m);
real capsule_shake(capsule_shaker *s, const capsule_numbers *n, const capsule_belief *b, const capsule_in *in,
                   capsule_out *out);
#endif

#if CAPSULE_MPC
void capsule_mpc_reset(capsule_planner *p, double now, real command);
/* The MPC's command after `in_force` and its rate; whether there is one. */
int capsule_mpc(const capsule_numbers *n, capsule_planner *p, const capsule_belief *belief, const capsule_in *in,
                real in_force, real in_force_rate, real *command);

/* Plans from `p->guess` into `p->best`; whether the last step gained little, or -1 without a finite plan. */
int capsule_planned(const capsule_numbers *n, capsule_planner *p, const real *state, real d, double now, real rate);
/* Changes of the rates into `p->y` by DAQP; whether there is a finite solution. */
int capsule_solved(capsule_planner *p, int unknowns, int rows);
#endif

#endif
