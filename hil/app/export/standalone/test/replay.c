/* Replays a log of ticks and compares every answer: `replay [ticks.csv]`. Its columns are explained in README.md. */
#include "controller.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef M7
#include "../m7/startup.h"
#endif

/* REPLAY_NEAR, REPLAY_FAR: largest difference of an answer in the first REPLAY_NEAR_TICKS and later; 0: identical to
   the last bit */

#define INPUTS (11 + 3 * CAPSULE_READINGS + 2 * (CAPSULE_STAGES + 1))
#define COLUMNS (INPUTS + 2)
#define MOST_TICKS 100000
enum { LISTENS, BEGINS, CONTROLS }; /* phases of a tick */

static capsule_state state;
static capsule_in in;
#ifndef CAPSULE_ESTIMATOR_ONLY
static capsule_out out;
#endif
static char line[32 * COLUMNS];
static double row[COLUMNS], begin_s, begin_command;
static long ticks, compared, failed;
static double farthest;

static int parsed(void) {
    char *at = line, *end;
    for (int k = 0; k < COLUMNS; k++, at = end + 1) {
        row[k] = strtod(at, &end);
        if (end == at || *end != (k < COLUMNS - 1 ? ',' : '\n')) return 0;
    }
    return 1;
}

static const double *take(real *to, const double *from, int count) {
    for (int k = 0; k < count; k++) to[k] = (real)from[k];
    return from + count;
}

/* The phase of the tick in `row`, whose inputs go into `in`. */
static int filled(void) {
    const double *at = row;
    const int phase = (int)*at++;
    begin_s = *at++;
    begin_command = *at++;
    in.time_s = *at++;
    in.readings = (int)*at++;
    for (int k = 0; k < CAPSULE_READINGS; k++, at += 3) {
        in.reading[k].stamp_s = at[0];
        in.reading[k].value = (real)at[1];
        in.reading[k].channel = (int)at[2];
    }
    at = take(&in.in_force, at, 1);
    in.halt = (int)*at++;
    at = take(in.position_m, at, CAPSULE_STAGES + 1);
    at = take(in.speed_m_s, at, CAPSULE_STAGES + 1);
    at = take(&in.next_speed_m_s, at, 1);
    at = take(&in.least, at, 1);
    at = take(&in.most, at, 1);
    take(&in.temperature_C, at, 1);
    return phase;
}

static void stepped(int phase) {
    capsule_estimate(&state.estimator, &in);
#ifndef CAPSULE_ESTIMATOR_ONLY
    if (phase == BEGINS)
        capsule_controller_init(&state.controller, &capsule_deployment, begin_s, &state.estimator.belief,
                                (real)begin_command);
    if (phase != LISTENS) capsule_control(&state.controller, &state.estimator.belief, &in, &out);
#else
    (void)phase;
#endif
}

static void compare(double answer, double logged) {
    const double off = fabs(answer - logged);
    const int same = memcmp(&answer, &logged, sizeof answer) == 0 || off <= (ticks < REPLAY_NEAR_TICKS ? REPLAY_NEAR : REPLAY_FAR);
    if (off > farthest) farthest = off;
    compared++;
    failed += !same;
    if (!same && failed <= 5) printf("tick %ld: %.17g, the log has %.17g\n", ticks, answer, logged);
}

#ifdef M7
static uint32_t count[MOST_TICKS];
static uint32_t stack;

static void measured(int phase) {
    const int here = 0;
    if (ticks % 64 == 0) paint_stack();
    const uint32_t began = systick();
    stepped(phase);
    count[ticks % MOST_TICKS] = phase == CONTROLS ? instructions_since(began) : 0;
    const uint32_t used = stack_below(&here);
    if (used > stack) stack = used;
}

static int ascending(const void *a, const void *b) {
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

static void told(void) {
    const long n = ticks < MOST_TICKS ? ticks : MOST_TICKS;
    qsort(count, (size_t)n, sizeof count[0], ascending);
    printf("instructions: median %lu, 99 of 100 %lu, most %lu; ", (unsigned long)count[n / 2],
           (unsigned long)count[n - 1 - n / 100], (unsigned long)count[n - 1]);
    printf("bytes: state %lu, stack %lu\n", (unsigned long)sizeof state, (unsigned long)stack);
}
#else
#define measured stepped
static void told(void) {}
#endif

int main(int argc, char **argv) {
    const char *path = argc > 1 ? argv[1] : "test/ticks.csv";
    FILE *file = fopen(path, "r");
    if (!file || !fgets(line, sizeof line, file)) {
        printf("%s must be a log of ticks that can be read\n", path);
        return 2;
    }
    for (; fgets(line, sizeof line, file); ticks++) {
        if (!parsed()) {
            printf("%s: row %ld must have %d numbers\n", path, ticks + 1, COLUMNS);
            return 2;
        }
        const int phase = filled();
        if (ticks == 0) capsule_estimator_init(&state.estimator, &capsule_deployment, begin_s, (real)begin_command);
        measured(phase);
#ifdef CAPSULE_ESTIMATOR_ONLY
        compare((double)state.estimator.belief.state[0], row[INPUTS + 1]);
#else
        if (phase != LISTENS) compare((double)out.command, row[INPUTS]);
#endif
    }
    fclose(file);
    told();
    printf("farthest from the log: %g\n", farthest);
    printf("%ld passed, %ld failed\n", compared - failed, failed);
    return failed != 0 || compared == 0;
}
