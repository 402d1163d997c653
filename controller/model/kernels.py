"""The control model's step as machine code, with the loops over it of estimators and MPC."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numba import njit
from numpy.typing import NDArray

from controller.model.symbols import Symbols
from controller.signals import Array
from models.compiled.kernel import LANES
from models.compiled.machine_code import Code, addresses, call

Motion = tuple[float, float, float, int, Array]
compiled = njit(cache=True, error_model="numpy")


@compiled
def _copy(to: Array, source: Array, first: int, size: int, begin: int) -> None:
    """`to[first : first + size] = source[begin : begin + size]`, which numba takes seconds to compile."""
    for i in range(size):
        to[first + i] = source[begin + i]


@compiled
def _work(x: Array, parameters: Array, d: float) -> Array:
    n, m = x.shape[0], parameters.shape[0]
    work = np.zeros(n + m + 1 + n * (n + 3))
    _copy(work, x, 0, n, 0)
    _copy(work, parameters, n, m, 0)
    work[n + m] = d
    return work


@compiled
def _stage(
    code: int, work: Array, now: Array, command: float, after: float, t: float, stage: float, substeps: int
) -> None:
    h, rise = stage / substeps, (after - command) / substeps
    for j in range(substeps):
        now[0] = command + j * rise
        now[1] = now[0] + rise
        now[2] = t + j * h
        now[3] = h
        call(code, work, now)


@compiled
def _run(
    code: int,
    lanes: int,
    which: NDArray[np.int64],
    values: Array,
    states: Array,
    command: float,
    after: float,
    d: Array,
    t: float,
    tick: float,
    substeps: int,
    parameters: Array,
) -> None:
    """`lanes` states at a time, the last group filled up; each has its own `values` of the parameters `which`."""
    n, m, now = states.shape[1], parameters.shape[0], np.empty(4)
    work = np.empty((n + m + 1) * lanes)
    for i in range(m * lanes):
        work[n * lanes + i] = parameters[i // lanes]
    for first in range(0, states.shape[0], lanes):
        for lane in range(lanes):
            k = min(first + lane, states.shape[0] - 1)
            for i in range(n):
                work[i * lanes + lane] = states[k, i]
            for i in range(which.size):
                work[(n + which[i]) * lanes + lane] = values[i, k]
            work[(n + m) * lanes + lane] = d[k]
        _stage(code, work, now, command, after, t, tick, substeps)
        for k in range(first, min(first + lanes, states.shape[0])):
            for i in range(n):
                states[k, i] = work[i * lanes + k - first]


@compiled
def _roll(code: int, path: Array, commands: Array, motion: Motion) -> None:
    d, t, stage, substeps, parameters = motion
    work, now = _work(path[0], parameters, d), np.empty(4)
    for k in range(commands.shape[0] - 1):
        _stage(code, work, now, commands[k], commands[k + 1], t + k * stage, stage, substeps)
        _copy(path[k + 1], work, 0, path.shape[1], 0)


@compiled
def _pursue(
    code: int, inverse: int, path: Array, commands: Array, wanted: Array, bounds: tuple[float, ...], motion: Motion
) -> None:
    (catch, rate, low, high), (d, t, stage, substeps, parameters) = bounds, motion
    work, now = _work(path[0], parameters, d), np.empty(4)
    aimed = path.shape[1] + parameters.shape[0] + 1
    for k in range(commands.shape[0] - 1):
        now[0] = wanted[1, k + 1] + (wanted[0, k + 1] - work[0]) / catch
        now[1] = t + k * stage
        call(inverse, work, now)
        c = min(max(work[aimed], commands[k] - rate * stage), commands[k] + rate * stage)
        commands[k + 1] = min(max(c, low), high)
        _stage(code, work, now, commands[k], commands[k + 1], t + k * stage, stage, substeps)
        _copy(path[k + 1], work, 0, path.shape[1], 0)


@compiled
def _holds(code: int, path: Array, forces: Array, slopes: Array, t: float, stage: float, parameters: Array) -> None:
    n, work, now = path.shape[1], _work(path[0], parameters, 0.0), np.empty(1)
    held = n + parameters.shape[0] + 1
    for k in range(path.shape[0]):
        _copy(work, path[k], 0, n, 0)
        now[0] = t + k * stage
        call(code, work, now)
        forces[k] = work[held]
        _copy(slopes[k], work, 0, n, held + 1)


@compiled
def _linearise(code: int, path: Array, A: Array, B: Array, commands: Array, motion: Motion) -> None:
    d, t, stage, substeps, parameters = motion
    n, work, now = path.shape[1], _work(path[0], parameters, d), np.empty(4)
    J = work[n + parameters.shape[0] + 1 :]  # column by column
    S, moved = np.zeros((n, n + 2)), np.zeros(n)
    now[3] = stage / substeps
    for k in range(commands.shape[0] - 1):
        rise = (commands[k + 1] - commands[k]) / substeps
        for i in range(n):
            for m in range(n + 2):
                S[i, m] = 1.0 if i == m else 0.0
        for j in range(substeps):
            now[0] = commands[k] + j * rise
            now[1] = now[0] + rise
            now[2] = t + k * stage + j * now[3]
            call(code, work, now)
            first, last = j / substeps, (j + 1) / substeps
            for m in range(n + 2):
                for i in range(n):
                    moved[i] = 0.0
                    for o in range(n):
                        moved[i] += J[n * o + i] * S[o, m]
                for i in range(n):
                    S[i, m] = moved[i]
            for i in range(n):
                by_c0, by_c1 = J[n * n + i], J[n * (n + 1) + i]
                S[i, n] += by_c0 * (1 - first) + by_c1 * (1 - last)
                S[i, n + 1] += by_c0 * first + by_c1 * last
        _copy(path[k + 1], work, 0, n, 0)
        for i in range(n):
            _copy(A[k, i], S[i], 0, n, 0)
            _copy(B[k, i], S[i], 0, 2, n)


@dataclass(frozen=True)
class Kernels:
    """Compiled functions of one model; arrays are C-contiguous float64, n states, changed in place, only scratch memory
    is allocated.

    - `run(states (m, n), command, after, disturbance_N (m,), t, tick_s, substeps, parameters)`: m states, each with its
      own disturbance, while the command moves linearly from `command` to `after`; `run_each(which (k,), values (k, m),
      states, ...)`: with the parameters at `which` per state.
    - `roll(path (N + 1, n), commands (N + 1,), motion)`: from `path[0]` N stages, the command linear between
      `commands`; fills `path[1:]`. A `motion` is (disturbance_N, t, stage_s, substeps, parameters).
    - `linearise(path, A (N, n, n), B (N, n, 2), commands, motion)`: the same with `dx_next = A dx + B (dc0, dc1)`.
    - `pursue(path, commands, wanted (2, N + 1), (catch_s, rate, low, high), motion)`: the same with commands that
      follow the `wanted` positions and speeds by inverting the model, an error decays with `catch_s`; fills
      `commands[1:]` too.
    - `holds(path, forces (N + 1,), slopes (N + 1, n), t, stage_s, parameters)`: the wall's force in N along a path, and
      its slopes.
    """

    parameters: Array
    tick_s: float
    substeps: int
    run: Callable[..., None]
    run_each: Callable[..., None]
    roll: Callable[..., None]
    linearise: Callable[..., None]
    pursue: Callable[..., None]
    holds: Callable[..., None]


def compile_kernels(symbols: Symbols, values: Array, tick_s: float, substeps: int) -> Kernels:
    """The functions of `symbols`; the code has no parameters inside, so other `values` reuse it."""
    n, m = len(symbols.states), len(symbols.parameters)
    end = n + m + 1
    codes = [
        Code(symbols.substep, {0: 0, 3: n + m, 6: n}, (0,)),
        Code(symbols.slopes, {0: 0, 3: n + m, 6: n}, (0, end)),
        Code(symbols.pursuit, {0: 0, 2: n + m, 4: n}, (end,)),
        Code(symbols.wall_slopes, {0: 0, 2: n}, (end, end + 1)),
    ]
    step, slopes, inverse, wall = addresses(codes)
    return Kernels(
        np.ascontiguousarray(values, dtype=float),
        tick_s,
        substeps,
        run=partial(_run, step, 1, np.zeros(0, dtype=np.int64), np.zeros((0, 0))),
        run_each=partial(_run, addresses(codes[:1], LANES)[0], LANES),
        roll=partial(_roll, step),
        linearise=partial(_linearise, slopes),
        pursue=partial(_pursue, step, inverse),
        holds=partial(_holds, wall),
    )
