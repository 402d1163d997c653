/* A found model's step, written out by CasADi, behind the core of fmi3.c.

   The header before this file has its numbers: STATES, PARAMETERS, INITIAL[], FOLLOWS[] (the states that begin at the
   command), STEP_S (0: one step a communication step), HELD, OFF_BEFORE (a switch), STARTS (2: place and speed at the
   start come before the model's parameters), OUTPUT, OUTPUTS as pairs of variable and state, WORK, IWORK. */
#include <math.h>
#include <string.h>

typedef struct {
    double state[STATES], command;
} Core;

static void once(Core *c, double *values, double c0, double c1, double t, double h) {
    double next[STATES], work[WORK];
    casadi_int places[IWORK];
    const double *arguments[ARGUMENTS] = {c->state, &c0, &c1, &t, &h, values + PARAMETERS_FROM + STARTS};
    double *results[RESULTS] = {next, values + OUTPUT};
    step(arguments, results, places, work, 0);
    memcpy(c->state, next, sizeof next);
    for (size_t k = 0; k < sizeof OUTPUTS / sizeof OUTPUTS[0]; k++) values[OUTPUTS[k][0]] = c->state[OUTPUTS[k][1]];
}

static void core_begin(Core *c, double *values) {
    double h = STEP_S > 0 ? STEP_S : 1e-3;
    c->command = OFF_BEFORE ? 0 : values[INPUT];
    for (int k = 0; k < STATES; k++) c->state[k] = FOLLOWS[k] ? c->command : INITIAL[k];
    if (STARTS) { /* the first step ends at the start */
        c->state[0] = values[PARAMETERS_FROM] - values[PARAMETERS_FROM + 1] * h;
        c->state[1] = values[PARAMETERS_FROM + 1];
    }
    once(c, values, c->command, c->command, -h, h);
}

static int core_step(Core *c, double *values, double t, double h) {
    double begin = HELD ? values[INPUT] : c->command, end = values[INPUT];
    long n = STEP_S > 0 ? lround(h / STEP_S) : 1;
    if (n < 1) n = 1;
    for (long j = 0; j < n; j++)
        once(c, values, begin + (end - begin) * ((double)j / n), begin + (end - begin) * ((double)(j + 1) / n),
             t + j * (h / n), h / n);
    c->command = end;
    return 0;
}
