"""The numbers of one SQP step, compiled: cost of a plan, its hard bounds, condensed Hessian and gradient."""

import numba
import numpy as np

from controller.signals import Array

Task = tuple[Array, float, float]  # reference (3, N + 1), the command's last rate, the stage in s
EXCESS = 10.0  # of the square beside the share by which a soft bound is exceeded
compiled = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})


@compiled
def keep_feasible(commands: Array, last_rate: float, stage: float, first: float, bounds: Array) -> None:
    """Move `commands` (N + 1,), in place, to where the hard bounds (low, high, rate, acceleration) hold and they can
    stop within the range; the first one stays, the rate may change from `last_rate` within `first` s.
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
    """Fill `Z` (N + 1, n, N): the states' derivatives by the command's rates, each moving the command by `step`."""
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
