/* min 1/2 y'Hy + f'y within bounds, as a least-distance problem for DAQP (Arnstrom, Bemporad, Axehill 2022) on static
   memory: u = R y + v with H = R'R and R'v = f, rows M = A R^-1 of norm 1. */
#include "internal.h"

#if CAPSULE_MPC
#ifdef CAPSULE_FLOAT32
#define DAQP_SINGLE_PRECISION
#endif
#include "daqp.h"

#define LIMIT 300 /* iterations of the active set */
#ifdef CAPSULE_FLOAT32
#define PRIMAL_TOL 1e-4f
#define DUAL_TOL 1e-6f
#define ZERO_TOL 1e-7f
#define SINGULAR_TOL 1e-6f
#define PIVOT_TOL 1e-5f
#define PROGRESS_TOL 1e-6f
#define REFACTOR_TOL 1e-5f
#else
#define PRIMAL_TOL DAQP_DEFAULT_PRIM_TOL
#define DUAL_TOL DAQP_DEFAULT_DUAL_TOL
#define ZERO_TOL DAQP_DEFAULT_ZERO_TOL
#define SINGULAR_TOL DAQP_DEFAULT_SING_TOL
#define PIVOT_TOL DAQP_DEFAULT_PIVOT_TOL
#define PROGRESS_TOL DAQP_DEFAULT_PROG_TOL
#define REFACTOR_TOL DAQP_DEFAULT_REFACTOR_TOL
#endif

/* The inverse of R by rows of its upper half, H = R'R; whether H is positive definite. */
static int factored(capsule_planner *p, int n)
{
    real R_[CAPSULE_RATES][CAPSULE_RATES], *packed = p->inverse;
    int i, j, k;
    for (i = 0; i < n; i++) {
        real pivot = p->H[i][i];
        for (j = i; j < n; j++) {
            R_[i][j] = p->H[j][i];
        }
        for (k = 0; k < i; k++) {
            const real c = R_[k][i];
            pivot -= c * c;
            for (j = i + 1; j < n; j++) {
                R_[i][j] -= c * R_[k][j];
            }
        }
        if (!(pivot > ZERO_TOL)) {
            return 0;
        }
        R_[i][i] = R(1) / real_sqrt(pivot);
        for (j = i + 1; j < n; j++) {
            R_[i][j] *= R_[i][i];
        }
    }
    for (i = 0; i < n; i++) { /* row i of the inverse solves R'x = e_i, taken along */
        real *row = packed;
        row[0] = R_[i][i];
        for (j = i + 1; j < n; j++) {
            row[j - i] = -row[0] * R_[i][j];
        }
        for (k = i + 1; k < n; k++) {
            const real x = row[k - i] * R_[k][k];
            row[k - i] = x;
            for (j = k + 1; j < n; j++) {
                row[j - i] -= x * R_[k][j];
            }
        }
        packed += n - i;
    }
    return 1;
}

/* Rows of the general constraints over R, each normalised; ignored where they are zero. */
static void transformed(capsule_planner *p, int n, int rows)
{
    int i, j, k;
    for (i = 0; i < rows; i++) {
        real *m = &p->M[i * n], size = 0;
        const real *inverse = p->inverse;
        memset(m, 0, (size_t)n * sizeof *m);
        for (k = 0; k < n; k++) {
            const real a = p->rows[i][k];
            for (j = k; a != 0 && j < n; j++) {
                m[j] += a * inverse[j - k];
            }
            inverse += n - k;
        }
        for (j = 0; j < n; j++) {
            size += m[j] * m[j];
        }
        p->scaling[n + i] = R(1);
        if (size < ZERO_TOL) {
            p->sense[n + i] = DAQP_IMMUTABLE;
            continue;
        }
        p->scaling[n + i] = R(1) / real_sqrt(size);
        for (j = 0; j < n; j++) {
            m[j] *= p->scaling[n + i];
        }
    }
}

/* v = R'^-1 f, the simple bounds' rows normalised, and the bounds seen from v. */
static void shifted(capsule_planner *p, int n, int rows)
{
    real *inverse = p->inverse, sum;
    int i, j;
    memset(p->v, 0, sizeof p->v);
    for (i = 0; i < n; i++) {
        real size = 0;
        for (j = i; j < n; j++) {
            p->v[j] += inverse[j - i] * p->f[i];
            size += inverse[j - i] * inverse[j - i];
        }
        p->scaling[i] = R(1) / real_sqrt(size);
        for (j = i; j < n; j++) {
            inverse[j - i] *= p->scaling[i];
        }
        inverse += n - i;
    }
    inverse = p->inverse;
    for (i = 0; i < n + rows; i++) {
        const real *m = i < n ? inverse - i : &p->M[(i - n) * n];
        for (j = i < n ? i : 0, sum = 0; j < n; j++) {
            sum += m[j] * p->v[j];
        }
        inverse += i < n ? n - i : 0;
        p->upper[i] = p->upper[i] * p->scaling[i] + sum;
        p->lower[i] = p->lower[i] * p->scaling[i] + sum;
    }
}

static DAQPSettings settings_of_solver(void)
{
    DAQPSettings s;
    memset(&s, 0, sizeof s);
    s.primal_tol = PRIMAL_TOL;
    s.dual_tol = DUAL_TOL;
    s.zero_tol = ZERO_TOL;
    s.pivot_tol = PIVOT_TOL;
    s.progress_tol = PROGRESS_TOL;
    s.cycle_tol = DAQP_DEFAULT_CYCLE_TOL;
    s.iter_limit = LIMIT;
    s.fval_bound = DAQP_INF;
    s.rho_soft = R(DAQP_DEFAULT_RHO_SOFT);
    s.sing_tol = SINGULAR_TOL;
    s.refactor_tol = REFACTOR_TOL;
    s.eq_reduction = DAQP_EQ_REDUCTION_OFF;
    return s;
}

static void lend(capsule_planner *p, DAQPWorkspace *work)
{
    work->M = p->M;
    work->dupper = p->upper;
    work->dlower = p->lower;
    work->Rinv = p->inverse;
    work->v = p->v;
    work->sense = p->sense;
    work->scaling = p->scaling;
    work->x = p->u;
    work->u = p->u;
    work->xold = p->before;
    work->lam = p->lam;
    work->lam_star = p->star;
    work->L = p->L;
    work->D = p->D;
    work->xldl = p->xldl;
    work->zldl = p->zldl;
    work->WS = p->active;
    work->prox_mask = p->masked;
    work->Mu = p->Mu;
}

int capsule_solved(capsule_planner *p, int unknowns, int rows)
{
    DAQPSettings settings = settings_of_solver();
    DAQPWorkspace work;
    real sum = 0;
    int i, flag;
    for (i = 0; i < unknowns + rows; i++) {
        if (!(p->upper[i] - p->lower[i] >= -PRIMAL_TOL)) {
            return 0;
        }
        p->sense[i] = p->upper[i] - p->lower[i] < ZERO_TOL ? DAQP_ACTIVE | DAQP_IMMUTABLE : 0;
    }
    if (!factored(p, unknowns)) {
        return 0;
    }
    transformed(p, unknowns, rows);
    shifted(p, unknowns, rows);
    memset(&work, 0, sizeof work);
    memset(p->u, 0, sizeof p->u);
    work.n = unknowns;
    work.m = unknowns + rows;
    work.ms = unknowns;
    work.settings = &settings;
    work.state = DAQP_STATE_RINV_NORMALIZED;
    lend(p, &work);
    reset_daqp_workspace(&work);
    flag = daqp_activate_constraints(&work);
    if (flag > 0) {
        flag = daqp_ldp(&work);
        p->iterations += work.iterations;
    }
    if (flag <= 0) {
        return 0;
    }
    ldp2qp_solution(&work);
    for (i = 0; i < unknowns; i++) {
        p->y[i] = work.x[i];
        sum += p->y[i];
    }
    return isfinite(sum);
}
#else
typedef int capsule_no_qp;
#endif
