/* Ticks with any bits as inputs: `random_bits TICKS SEED`. Every command must be finite and within the range. */
#include "controller.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint64_t state64;

static uint32_t draw(void) {
    state64 ^= state64 << 13;
    state64 ^= state64 >> 7;
    state64 ^= state64 << 17;
    return (uint32_t)(state64 >> 16);
}

static double near(double scale) { return scale * ((double)draw() / 2147483648.0 - 1.0); }

static void spoil(void *what, size_t bytes) {
    for (size_t k = 0; k < bytes; k++) ((unsigned char *)what)[k] = (unsigned char)draw();
}

/* One tick as it should be: a capsule that creeps, read every fifth tick. */
static void sound(capsule_in *in, double time_s, double place_m, unsigned long tick) {
    memset(in, 0, sizeof *in);
    in->time_s = time_s;
    in->reading[0] = (capsule_reading){time_s - 2e-3, (real)place_m, CAPSULE_COMMANDED};
    in->reading[1] = (capsule_reading){time_s - 4e-3, (real)(place_m + near(5e-4)), CAPSULE_POSITION};
    in->readings = tick % 5 == 0 ? 2 : 1;
    in->in_force = (real)NAN;
    in->least = -(real)INFINITY;
    in->most = (real)INFINITY;
    in->temperature_C = 25;
    for (int k = 0; k <= CAPSULE_STAGES; k++) in->position_m[k] = (real)(place_m + near(1e-4));
}

/* Any bits in one part of the inputs, or in all of them. */
static void spoiled(capsule_in *in) {
    switch (draw() % 8) {
        case 0: spoil(in, sizeof *in); break;
        case 1: spoil(&in->time_s, sizeof in->time_s); break;
        case 2: spoil(&in->readings, sizeof in->readings); break;
        case 3: spoil(in->reading, sizeof in->reading); break;
        case 4: spoil(&in->reading[1].value, sizeof in->reading[1].value); break;
        case 5: spoil(in->position_m, sizeof in->position_m); break;
        case 6: spoil(in->speed_m_s, sizeof in->speed_m_s); break;
        default: spoil(&in->in_force, sizeof in->in_force); break;
    }
    if (draw() % 4) in->halt = 0;
}

int main(int argc, char **argv) {
    static capsule_state state;
    static capsule_in in;
    const unsigned long ticks = argc > 1 ? strtoul(argv[1], NULL, 10) : 1000;
    state64 = argc > 2 ? strtoull(argv[2], NULL, 10) : 1;
    unsigned long led = 0, begun = 0;
#ifndef CAPSULE_ESTIMATOR_ONLY
    static capsule_out out;
#endif
    double time_s = 0.0, place_m = 0.0;
    for (unsigned long k = 0; k < ticks; k++) {
        if (k % 1000 == 0) {
#ifdef CAPSULE_ESTIMATOR_ONLY
            capsule_estimator_init(&state.estimator, &capsule_deployment, time_s, (real)place_m);
#else
            capsule_init(&state, &capsule_deployment, time_s, (real)place_m);
#endif
            begun++;
        }
        time_s += (double)capsule_deployment.tick_s;
        place_m += near(1e-5);
        sound(&in, time_s, place_m, k);
        if (k % 1000 > 500 && draw() % 3 == 0) spoiled(&in);
#ifdef CAPSULE_ESTIMATOR_ONLY
        capsule_estimate(&state.estimator, &in);
        led += !state.estimator.belief.lost && isfinite(state.estimator.belief.state[0]);
#else
        capsule_step(&state, &in, &out);
        led += out.status == CAPSULE_OK || out.status == CAPSULE_LIMITED;
        if (!(out.command >= capsule_deployment.low && out.command <= capsule_deployment.high)) {
            printf("tick %lu: command %g\n", k, (double)out.command);
            return 1;
        }
#endif
    }
    printf("%lu ticks, %lu begins, %lu led\n", ticks, begun, led);
    return led < ticks / 100;
}
