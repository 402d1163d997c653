"""One SQP step in numbers: the cost of a plan, its condensed quadratic program and the solution by daqp."""

import daqp
import numba
import numpy as np

from controller.signals import Array

Task = tuple[Array, float, float]  # reference (3, N + 1), the command's last rate, the stage in s
EXCESS = 10.0  # weight of the square of the share by which a soft bound is exceeded
compiled = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})


@compiled
def keep_feasible(commands: Array, last_rate: float, stage: float, first: float, bounds: Array) -> None:
    """Move `commands` (N + 1,), in place, so that the hard bounds (low, high, rate, acceleration) hold and they can
    stop within the range. The first one stays; the rate may change from `last_rate` within `first` s.
    """
    low, high, most, bend = bounds[0], bounds[1], bounds[2], bounds[3]
    rate = min(max(last_rate, -most), most)
    for k in range(commands.shape[0] - 1):
        change = bend * (first if k == 0 else stage)
        wanted = (commands[k + 1] - commands[k]) / stage
        ahead, behind = max(high - commands[k], 0.0), max(commands[k] - low, 0.0)
        up = 2 * ahead / (np.sqrt(stage * stage + 2 * ahead / bend) + stage)
        down = 2 * behind / (np.sqrt(stage * stage + 2 * behind / bend) + stage)
        wanted = min(max(wanted, -most, -down), most, up)
        wanted = min(max(wanted, rate - change), rate + change)
        commands[k + 1] = min(max(commands[k] + wanted * stage, low), high)
        rate = (commands[k + 1] - commands[k]) / stage


@compiled
def cost(path: Array, commands: Array, forces: Array, task: Task, scales: Array, soft: Array, penalty: Array) -> float:
    """A plan's cost; `reference` (3, N + 1): position, speed, rate; `scales`: position, speed, rate, jump, final."""
    reference, rate, stage = task
    total, n = 0.0, commands.shape[0] - 1
    for j in range(3):
        worst = 0.0
        for k in range(1, n + 1):
            value = commands[k] - path[k, 0] if j == 0 else path[k, 1] if j == 1 else forces[k]
            worst = max(worst, abs(value) / soft[j] - 1)
        total += penalty[j] * worst * (1 + 0.5 * EXCESS * worst)
    for k in range(1, n + 1):
        weight = scales[4] if k == n else 1.0
        total += 0.5 * weight * ((path[k, 0] - reference[0, k]) / scales[0]) ** 2
        total += 0.5 * ((path[k, 1] - reference[1, k]) / scales[1]) ** 2
        now = (commands[k] - commands[k - 1]) / stage
        total += 0.5 * ((now - reference[2, k - 1]) / scales[2]) ** 2 + 0.5 * ((now - rate) / scales[3]) ** 2
        rate = now
    return total


@compiled
def sensitivities(A: Array, B: Array, step: float, Z: Array) -> None:
    """Fill `Z` (N + 1, n, N): derivatives of the states by the command's rates, which move it by `step`."""
    n = Z.shape[1]
    Z[0] = 0.0
    for k in range(A.shape[0]):
        Z[k + 1] = 0.0
        for i in range(n):
            for m in range(n):
                slope = A[k, i, m]
                if slope != 0.0:
                    for j in range(k):
                        Z[k + 1, i, j] += slope * Z[k, m, j]
            both = (B[k, i, 0] + B[k, i, 1]) * step
            for j in range(k):
                Z[k + 1, i, j] += both
            Z[k + 1, i, k] = B[k, i, 1] * step


@compiled
def quadratic(
    path: Array, commands: Array, Z: Array, task: Task, scales: Array, unit: float, H: Array, f: Array
) -> None:
    """Fill the leading (N, N) Hessian (Gauss-Newton) and (N,) gradient of the cost by the rates over `unit`."""
    reference, before, stage = task
    n = commands.shape[0] - 1
    H[:n, :n] = 0.0
    f[:n] = 0.0
    for k in range(1, n + 1):
        weight = scales[4] if k == n else 1.0
        px, pv = weight / scales[0] ** 2, 1 / scales[1] ** 2
        ex, ev = px * (path[k, 0] - reference[0, k]), pv * (path[k, 1] - reference[1, k])
        for i in range(k):
            zx, zv = Z[k, 0, i], Z[k, 1, i]
            f[i] += ex * zx + ev * zv
            for j in range(i + 1):
                H[i, j] += px * zx * Z[k, 0, j] + pv * zv * Z[k, 1, j]
    r, q = unit / scales[2], unit / scales[3]
    for k in range(n):
        now = (commands[k + 1] - commands[k]) / stage
        f[k] += r * (now - reference[2, k]) / scales[2] + q * (now - before) / scales[3]
        H[k, k] += r * r + q * q
        if k > 0:
            f[k - 1] -= q * (now - before) / scales[3]
            H[k - 1, k - 1] += q * q
            H[k, k - 1] -= q * q
        before = now
    for i in range(n):
        for j in range(i):
            H[j, i] = H[i, j]


Timing = tuple[float, float, float, Array]  # stage and tick in s, unit of the rates, hard bounds
FREE = 1e30  # no bound, for the solver
_NEAR = 0.6  # share of a bound above which it gets rows
_ITERATIONS = 300  # of the active set, at most


@compiled
def soft_rows(
    plan: tuple[Array, Array, Array, Array], Z: Array, step: float, soft: Array, rows: Array, upper: Array
) -> int:
    """Rows (m, N + 3) and right sides (m,) of `|value|/bound - slack <= 1` for stages near a soft bound; returns m."""
    path, commands, forces, slopes = plan
    n, count = commands.shape[0] - 1, 0
    for kind in range(3):
        near = False
        for k in range(1, n + 1):
            value = commands[k] - path[k, 0] if kind == 0 else path[k, 1] if kind == 1 else forces[k]
            near = near or abs(value) > _NEAR * soft[kind]
        if not near:
            continue
        for k in range(1, n + 1):
            value = commands[k] - path[k, 0] if kind == 0 else path[k, 1] if kind == 1 else forces[k]
            side = (1.0 if value >= 0 else -1.0) / soft[kind]
            rows[count] = 0.0
            for j in range(k):
                if kind == 0:
                    rows[count, j] = side * (step - Z[k, 0, j])
                elif kind == 1:
                    rows[count, j] = side * Z[k, 1, j]
                else:
                    for m in range(Z.shape[1]):
                        rows[count, j] += side * slopes[k, m] * Z[k, m, j]
            rows[count, n + kind] = -1.0
            upper[count] = 1.0 - side * value
            count += 1
    return count


@compiled
def hard_rows(
    commands: Array, last_rate: float, timing: Timing, rows: Array, upper: Array, lower: Array, simple: int, count: int
) -> int:
    """Fill in the hard bounds (low, high, rate, acceleration) of changes y of the rates over `unit`; returns the number
    of rows, `count` before. The rates' own bounds are the first N of `upper` and `lower`, row k's at `simple + k`. Rows
    of acceleration and range exist only while the plan is near them.
    """
    n, (stage, tick, unit, bounds) = commands.shape[0] - 1, timing
    low, high, most, bend = bounds[0], bounds[1], bounds[2], bounds[3]
    before, bent, close = last_rate, False, False
    for k in range(n):
        rate = (commands[k + 1] - commands[k]) / stage
        upper[k], lower[k] = (most - rate) / unit, (-most - rate) / unit
        if k == 0:
            upper[0] = max(min(upper[0], (last_rate + bend * tick - rate) / unit), 0.0)
            lower[0] = min(max(lower[0], (last_rate - bend * tick - rate) / unit), 0.0)
        elif abs(rate - before) > _NEAR * bend * stage:
            bent = True
        before = rate
        middle = 0.5 * (low + high)
        if abs(commands[k + 1] - middle) > _NEAR * (high - middle):
            close = True
    if bent:
        for k in range(1, n):
            jump = (commands[k + 1] - 2 * commands[k] + commands[k - 1]) / stage
            rows[count] = 0.0
            rows[count, k], rows[count, k - 1] = 1.0, -1.0
            upper[simple + count], lower[simple + count] = (bend * stage - jump) / unit, (-bend * stage - jump) / unit
            count += 1
    if close:
        for k in range(n):
            rows[count] = 0.0
            rows[count, : k + 1] = 1.0
            upper[simple + count] = (high - commands[k + 1]) / (unit * stage)
            lower[simple + count] = (low - commands[k + 1]) / (unit * stage)
            count += 1
    return count


class Program:
    """`min 1/2 y'Hy + f'y` over changes y of the N rates over `unit`, and three slacks. `hard`: low, high, rate,
    acceleration; `soft` (3,): bounds of gap, speed and wall force, `penalty` (3,): weights of their slacks. H and f are
    filled from outside.
    """

    def __init__(
        self, stages: int, stage_s: float, tick_s: float, unit: float, hard: Array, soft: Array, penalty: Array
    ) -> None:
        self.stages, self.stage_s, self.unit, self._soft = stages, stage_s, unit, soft
        self._timing = (stage_s, tick_s, unit, hard)
        n, most = stages + 3, 5 * stages
        self.H, self.f = np.eye(n), np.concatenate([np.zeros(stages), penalty])
        self.H[range(stages, n), range(stages, n)] = EXCESS * penalty
        self._rows, self._upper, self._lower = np.zeros((most, n)), np.zeros(n + most), np.zeros(n + most)

    def solve(
        self, path: Array, commands: Array, forces: Array, slopes: Array, Z: Array, last_rate: float
    ) -> Array | None:
        """Changes (N,) of the rates within the bounds near the plan; None without a finite solution."""
        n, upper, lower = self.stages, self._upper, self._lower
        step = self.unit * self.stage_s
        count = soft_rows((path, commands, forces, slopes), Z, step, self._soft, self._rows, upper[n + 3 :])
        size = n + 3 if count else n
        upper[n:size], lower[n:size] = FREE, 0.0
        lower[size : size + count] = -FREE
        count = hard_rows(commands, last_rate, self._timing, self._rows, upper, lower, size, count)
        top, rows, H = size + count, self._rows[:count], self.H
        if size == n:
            H, rows = H[:n, :n].copy(), rows[:, :n].copy()
        try:
            y, _, flag, _ = daqp.solve(H, self.f[:size], rows, upper[:top], lower[:top], None, iter_limit=_ITERATIONS)
        except (ValueError, TypeError, ArithmeticError, MemoryError):
            return None
        change: Array = np.asarray(y)[:n]
        return change if flag > 0 and np.isfinite(change.sum()) else None
