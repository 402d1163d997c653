/* Loops over the functions that CasADi wrote in front of this: substep, slopes, wall_slopes, pursuit. The same as in
   prediction_compiled.py. STATES and PARAMETERS are numbers of them, WORK what the functions want for scratch. Matrices of CasADi go down columns,
   those of the caller along rows. */

typedef long long int whole;

static void copy(double *to, const double *from, int count) {
  for (int i = 0; i < count; ++i) to[i] = from[i];
}

static void move(double *x, double c0, double c1, double d, double t, double h, const double *p) {
  double after[STATES], w[WORK];
  const double *arg[8] = {x, &c0, &c1, &d, &t, &h, p, 0};
  double *res[2] = {after, 0};
  substep(arg, res, 0, w, 0);
  copy(x, after, STATES);
}

static void stage_on(double *x, double c, double next, double d, double t, double h, whole substeps, const double *p) {
  double rise = (next - c) / substeps;
  for (whole j = 0; j < substeps; ++j) move(x, c + j * rise, c + (j + 1) * rise, d, t + j * h, h, p);
}

void run(double *states, whole count, double c, double next, const double *d, double t, double tick, whole substeps, const double *p) {
  for (whole k = 0; k < count; ++k) stage_on(states + k * STATES, c, next, d[k], t, tick / substeps, substeps, p);
}

void run_each(double *states, whole count, double c, double next, const double *d, double t, double tick, whole substeps,
              const double *p, whole which, const double *values) {
  double own[PARAMETERS];
  copy(own, p, PARAMETERS);
  for (whole k = 0; k < count; ++k) {
    own[which] = values[k];
    stage_on(states + k * STATES, c, next, d[k], t, tick / substeps, substeps, own);
  }
}

void roll(double *path, const double *c, whole stages, double d, double t, double stage, whole substeps, const double *p) {
  for (whole k = 0; k < stages; ++k) {
    copy(path + (k + 1) * STATES, path + k * STATES, STATES);
    stage_on(path + (k + 1) * STATES, c[k], c[k + 1], d, t + k * stage, stage / substeps, substeps, p);
  }
}

void pursue(double *path, double *c, const double *position, const double *speed, whole stages, double catch_s, double rate, double low,
            double high, double d, double t, double stage, whole substeps, const double *p) {
  double w[WORK], wanted, aim, now;
  for (whole k = 0; k < stages; ++k) {
    double *x = path + k * STATES;
    const double *arg[6] = {x, &wanted, &d, &now, p, 0};
    double *res[2] = {&aim, 0};
    now = t + k * stage;
    wanted = speed[k + 1] + (position[k + 1] - x[0]) / catch_s;
    pursuit(arg, res, 0, w, 0);
    if (aim < c[k] - rate * stage) aim = c[k] - rate * stage;
    if (aim > c[k] + rate * stage) aim = c[k] + rate * stage;
    c[k + 1] = aim < low ? low : aim > high ? high : aim;
    copy(x + STATES, x, STATES);
    stage_on(x + STATES, c[k], c[k + 1], d, now, stage / substeps, substeps, p);
  }
}

void holds(const double *path, double *forces, double *gradients, whole count, double t, double stage, const double *p) {
  double w[WORK], now;
  for (whole k = 0; k < count; ++k) {
    const double *arg[4] = {path + k * STATES, &now, p, 0};
    double *res[3] = {forces + k, gradients + k * STATES, 0};
    now = t + k * stage;
    wall_slopes(arg, res, 0, w, 0);
  }
}

void linearise(double *path, double *A, double *B, const double *c, whole stages, double d, double t, double stage, whole substeps,
               const double *p) {
  double J[STATES * (STATES + 3)], S[STATES][STATES + 2], moved[STATES], after[STATES], w[WORK];
  double c0, c1, now, h = stage / substeps;
  for (whole k = 0; k < stages; ++k) {
    double *x = path + (k + 1) * STATES, rise = (c[k + 1] - c[k]) / substeps;
    const double *arg[8] = {x, &c0, &c1, &d, &now, &h, p, 0};
    double *res[3] = {after, J, 0};
    copy(x, path + k * STATES, STATES);
    for (int i = 0; i < STATES; ++i)
      for (int m = 0; m < STATES + 2; ++m) S[i][m] = i == m;
    for (whole j = 0; j < substeps; ++j) {
      double first = (double)j / substeps, last = (double)(j + 1) / substeps;
      c0 = c[k] + j * rise, c1 = c0 + rise, now = t + k * stage + j * h;
      slopes(arg, res, 0, w, 0);
      copy(x, after, STATES);
      for (int m = 0; m < STATES + 2; ++m) {
        for (int i = 0; i < STATES; ++i) {
          moved[i] = 0;
          for (int l = 0; l < STATES; ++l) moved[i] += J[i + STATES * l] * S[l][m];
        }
        for (int i = 0; i < STATES; ++i) S[i][m] = moved[i];
      }
      for (int i = 0; i < STATES; ++i) {
        double by_c0 = J[i + STATES * STATES], by_c1 = J[i + STATES * (STATES + 1)];
        S[i][STATES] += by_c0 * (1 - first) + by_c1 * (1 - last);
        S[i][STATES + 1] += by_c0 * first + by_c1 * last;
      }
    }
    for (int i = 0; i < STATES; ++i) {
      copy(A + (k * STATES + i) * STATES, S[i], STATES);
      copy(B + (k * STATES + i) * 2, S[i] + STATES, 2);
    }
  }
}
