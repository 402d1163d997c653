/* The whole step, and the state it works on. */
#include "internal.h"

void capsule_init(capsule_state *state, const capsule_numbers *numbers, double begin_s, real command)
{
    capsule_estimator_init(&state->estimator, numbers, begin_s, command);
    capsule_controller_init(&state->controller, numbers, begin_s, &state->estimator.belief, command);
}

void capsule_step(capsule_state *state, const capsule_in *in, capsule_out *out)
{
    capsule_in given = *in;
    if (!isfinite(given.in_force)) {
        given.in_force = state->controller.issued.command;
    }
    capsule_estimate(&state->estimator, &given);
    capsule_control(&state->controller, &state->estimator.belief, &given, out);
}
