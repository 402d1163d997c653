/* The simulated plant's own compiled loops behind the core of fmi3.c.

   The header before this file has the rig's numbers: DT (s), STRAIGHT, SCALE, KIND, the sizes, where numbers
   stand in state and rows (S_..., O_...), OUTPUTS as pairs of variable and place, STAGES tables of hidden effects with
   the step at which each begins. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#define VECTOR void *, void *, int64_t, int64_t, double *, int64_t, int64_t
#define MATRIX void *, void *, int64_t, int64_t, double *, int64_t, int64_t, int64_t, int64_t
#define V(a, n) NULL, NULL, (n), 8, (double *)(a), (n), 8
#define M(a, n, m) NULL, NULL, (n) * (m), 8, (double *)(a), (n), (m), (m) * 8, 8

int capsule_advance(int64_t *, void **, int64_t, VECTOR, VECTOR, MATRIX, MATRIX, VECTOR, VECTOR, double, int64_t, MATRIX);
int capsule_lags(void **, void **, VECTOR, double, double, VECTOR);
int capsule_play(void **, void **, VECTOR, double, VECTOR);

enum { CHUNK = 1024 };

typedef struct {
    double state[S_COUNT], carriage[CARRIAGE], command;
    int64_t stage;
    int behind;
} Core;

static void arrive(double *values, int64_t n, const double *effects, double *memory) {
    void *none = NULL, *error = NULL;
    if (effects[LAG] != 0) capsule_lags(&none, &error, V(values, n), DT, effects[LAG], V(memory, CARRIAGE));
    if (effects[DRIVER] != 0) capsule_lags(&none, &error, V(values, n), DT, effects[DRIVER], V(memory, CARRIAGE));
    if (effects[PLAY] != 0) capsule_play(&none, &error, V(values, n), effects[PLAY], V(memory, CARRIAGE));
}

static int lagging(const double *effects) { return effects[LAG] != 0 || effects[DRIVER] != 0 || effects[PLAY] != 0; }

static void tell(Core *c, double *values) {
    for (size_t k = 0; k < sizeof OUTPUTS / sizeof OUTPUTS[0]; k++) values[OUTPUTS[k][0]] = c->state[OUTPUTS[k][1]];
}

static void core_begin(Core *c, double *values) {
    memset(c, 0, sizeof *c);
    c->state[S_DIRECTION] = 1;
    c->behind = lagging(EFFECTS[0]);
    values[FORCE] = 0;
    tell(c, values);
}

/* `n` steps, at most CHUNK, with the drive `path` of n + 1 values. */
static void advance(Core *c, double *values, double *path, int64_t n) {
    int64_t first = (int64_t)c->state[S_STEP], rows = 0;
    while (c->stage + 1 < STAGES && BEGINS[c->stage + 1] <= first) {
        c->stage++;
        int behind = lagging(EFFECTS[c->stage]);
        if (behind && !c->behind)
            for (int k = 0; k < CARRIAGE; k++) c->carriage[k] = path[0];
        c->behind = behind;
    }
    const double *effects = EFFECTS[c->stage];
    if (c->behind) {
        double ahead[CARRIAGE];
        arrive(path, n, effects, c->carriage);
        memcpy(ahead, c->carriage, sizeof ahead);
        arrive(path + n, 1, effects, ahead);
    }
    double out[2][O_COUNT];
    void *error = NULL;
    int64_t every = first + n > 1 ? first + n - 1 : 1; /* a row of the last step, and one of step 0 */
    capsule_advance(&rows, &error, KIND, V(c->state, S_COUNT), V(PARAMETERS, P_COUNT), M(effects, H_ROWS, H_SLOTS),
                    M(TABLES, L_COUNT, NODES), V(PROFILE, PROFILE_COUNT), V(path, n + 1), DT, every,
                    M(out, 2, O_COUNT));
    if (rows > 0) values[FORCE] = out[rows - 1][O_FORCE];
}

static int core_step(Core *c, double *values, double t, double h) {
    int64_t first = (int64_t)c->state[S_STEP], n = llround((t + h) / DT) - first;
    double path[CHUNK + 1], begin = c->command, end = values[INPUT];
    if (n < 1) return 1;
    for (int64_t k = 0; k < n;) {
        int64_t size = n - k < CHUNK ? n - k : CHUNK;
        for (int64_t stage = 0; stage < STAGES; stage++) {
            int64_t until = BEGINS[stage] - first - k;
            if (until > 0 && until < size) size = until;
        }
        for (int64_t j = 0; j <= size; j++)
            path[j] = !STRAIGHT ? SCALE * end : k + j == n ? end : begin + (end - begin) * ((double)(k + j) / n);
        advance(c, values, path, size);
        k += size;
    }
    c->command = end;
    tell(c, values);
    return 0;
}
