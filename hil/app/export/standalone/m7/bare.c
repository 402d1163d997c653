/* The least program around the controller, for the sizes of flash and RAM. */
#include "controller.h"

capsule_in in;

#ifdef CAPSULE_ESTIMATOR_ONLY
capsule_estimator estimator;

int main(void) {
    capsule_estimator_init(&estimator, &capsule_deployment, 0.0, 0);
    for (;;) capsule_estimate(&estimator, &in);
}
#else
capsule_state state;
capsule_out out;

int main(void) {
    capsule_init(&state, &capsule_deployment, 0.0, 0);
    for (;;) capsule_step(&state, &in, &out);
}
#endif
