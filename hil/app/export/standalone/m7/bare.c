/* The least program around the controller, for the sizes of flash and RAM. */
#include "controller.h"

capsule_state state;
capsule_in in;
capsule_out out;

int main(void) {
    capsule_init(&state, &capsule_deployment, 0.0, 0);
    for (;;) capsule_step(&state, &in, &out);
}
