"""The control model's step as machine code, and the loops over it that estimators and the MPC ask for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from controller.model.symbols import Symbols
from models.compiled.machine_code import Code, addresses, call

Array = NDArray[np.float64]
compiled = njit(cache=True, error_model="numpy")


@compiled
def _copy(to: Array, source: Array, first: int, size: int, begin: int) -> None:
    """`to[first : first + size] = source[begin : begin + size]`, which takes numba seconds to compile."""
    for i in range(size):
        to[first + i] = source[begin + i]


@compiled
def _work(path: Array, parameters: Array) -> Array:
    """Room for what a model's code reads and writes: state, parameters, results."""
    n, m = path.shape[1], parameters.shape[0]
    work = np.zeros(n + m + n * (n + 3))
    _copy(work, parameters, n, m, 0)
    return work


@compiled
def _stage(
    code: int, work: Array, x: Array, command: float, after: float, d: float, t: float, h: float, substeps: int
) -> None:
    """Move the state `x` (n,) on by `substeps` steps of `h`."""
    n = x.shape[0]
    now, rise = np.empty(5), (after - command) / substeps
    _copy(work, x, 0, n, 0)
    now[2], now[4] = d, h
    for j in range(substeps):
        now[0] = command + j * rise
        now[1] = now[0] + rise
        now[3] = t + j * h
        call(code, work, now)
    _copy(x, work, 0, n, 0)


@compiled
def _run_each(
    code: int,
    states: Array,
    command: float,
    after: float,
    d: Array,
    t: float,
    tick: float,
    substeps: int,
    parameters: Array,
    which: int,
    values: Array,
) -> None:
    n, work = states.shape[1], _work(states, parameters)
    for k in range(states.shape[0]):
        if which >= 0:
            work[n + which] = values[k]
        _stage(code, work, states[k], command, after, d[k], t, tick / substeps, substeps)


@compiled
def _roll(
    code: int, path: Array, commands: Array, d: float, t: float, stage: float, substeps: int, parameters: Array
) -> None:
    work = _work(path, parameters)
    for k in range(commands.shape[0] - 1):
        _copy(path[k + 1], path[k], 0, path.shape[1], 0)
        _stage(code, work, path[k + 1], commands[k], commands[k + 1], d, t + k * stage, stage / substeps, substeps)


@compiled
def _pursue(
    codes: tuple[int, int],
    path: Array,
    commands: Array,
    position: Array,
    speed: Array,
    catch: float,
    rate: float,
    low: float,
    high: float,
    d: float,
    t: float,
    stage: float,
    substeps: int,
    parameters: Array,
) -> None:
    n, work, now = path.shape[1], _work(path, parameters), np.empty(3)
    aimed = n + parameters.shape[0]
    for k in range(commands.shape[0] - 1):
        _copy(work, path[k], 0, n, 0)
        now[0] = speed[k + 1] + (position[k + 1] - path[k, 0]) / catch
        now[1], now[2] = d, t + k * stage
        call(codes[1], work, now)
        c = min(max(work[aimed], commands[k] - rate * stage), commands[k] + rate * stage)
        commands[k + 1] = min(max(c, low), high)
        _copy(path[k + 1], path[k], 0, path.shape[1], 0)
        _stage(codes[0], work, path[k + 1], commands[k], commands[k + 1], d, now[2], stage / substeps, substeps)


@compiled
def _holds(code: int, path: Array, forces: Array, slopes: Array, t: float, stage: float, parameters: Array) -> None:
    n, work, now = path.shape[1], _work(path, parameters), np.empty(1)
    held = n + parameters.shape[0]
    for k in range(path.shape[0]):
        _copy(work, path[k], 0, n, 0)
        now[0] = t + k * stage
        call(code, work, now)
        forces[k] = work[held]
        _copy(slopes[k], work, 0, n, held + 1)


@compiled
def _linearise(
    code: int,
    path: Array,
    A: Array,
    B: Array,
    commands: Array,
    d: float,
    t: float,
    stage: float,
    substeps: int,
    parameters: Array,
) -> None:
    n, work, now = path.shape[1], _work(path, parameters), np.empty(5)
    J = work[n + parameters.shape[0] :]  # column by column
    S, moved = np.zeros((n, n + 2)), np.zeros(n)
    now[2], now[4] = d, stage / substeps
    for k in range(commands.shape[0] - 1):
        _copy(work, path[k], 0, n, 0)
        rise = (commands[k + 1] - commands[k]) / substeps
        for i in range(n):
            for m in range(n + 2):
                S[i, m] = 1.0 if i == m else 0.0
        for j in range(substeps):
            now[0] = commands[k] + j * rise
            now[1] = now[0] + rise
            now[3] = t + k * stage + j * now[4]
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
    """Compiled functions of one model; arrays are C-contiguous float64, n states, all changed in place, nothing
    allocated but scratch.

    - `step(x (n,), command, disturbance_N, t) -> (n,)`: one tick, a new array.
    - `steps(states (m, n), command, disturbance_N (m,), t)`: one tick of m states at once, in place (a filter's sigma
      points).
    - `run(states (m, n), command, after, disturbance_N (m,), t, tick_s, substeps, parameters)`: the same in a time of
      its own, in which the command goes in a straight line from `command` to `after`; `run_each(..., parameters, which,
      values (m,))`: with the parameter at `which` each state's own.
    - `roll(path (N + 1, n), commands (N + 1,), disturbance_N, t, stage_s, substeps, parameters)`: from `path[0]` N
      stages of `stage_s` in which the command goes in a straight line from one of `commands` to the next; fills
      `path[1:]`.
    - `linearise(path, A (N, n, n), B (N, n, 2), commands, ...)`: the same with `dx_next = A dx + B (dc0, dc1)`.
    - `pursue(path, commands, position (N + 1,), speed (N + 1,), catch_s, rate, low, high, disturbance_N, ...)`: the
      same with commands that follow `position` and `speed` by inverting the model, an error fading with `catch_s`;
      fills `commands[1:]` too.
    - `holds(path, forces (N + 1,), slopes (N + 1, n), t, stage_s, parameters)`: the wall's force in N along a path, and
      its slopes.
    """

    codes: Mapping[str, int]
    parameters: Array
    tick_s: float
    substeps: int

    def step(self, x: Array, command: float, disturbance_N: float, t: float) -> Array:
        """The state (n,) a tick later."""
        states = np.array(x, dtype=float).reshape(1, -1)
        self.steps(states, command, np.array([disturbance_N]), t)
        return np.asarray(states[0])

    def steps(self, states: Array, command: float, disturbance_N: Array, t: float) -> None:
        """Move `states` (m, n), each under its own disturbance (m,), a tick on, in place."""
        self.run(states, command, command, disturbance_N, t, self.tick_s, self.substeps, self.parameters)

    def run(self, states: Array, command: float, after: float, d: Array, t: float, *pace: Any) -> None:
        """See above, as of all that follow."""
        self.run_each(states, command, after, d, t, *pace, -1, d)

    def run_each(self, *arguments: Any) -> None:
        _run_each(self.codes["substep"], *arguments)

    def roll(self, *arguments: Any) -> None:
        _roll(self.codes["substep"], *arguments)

    def linearise(self, *arguments: Any) -> None:
        _linearise(self.codes["slopes"], *arguments)

    def pursue(self, *arguments: Any) -> None:
        _pursue((self.codes["substep"], self.codes["pursuit"]), *arguments)

    def holds(self, *arguments: Any) -> None:
        _holds(self.codes["wall_slopes"], *arguments)


def compile_kernels(symbols: Symbols, values: Array, tick_s: float, substeps: int) -> Kernels:
    """The functions of `symbols` at the parameters `values`; the code holds no parameter, so other values of the same
    model reuse it.
    """
    n = len(symbols.states)
    end = n + len(symbols.parameters)
    outputs = {"substep": (0,), "slopes": (0, end), "wall_slopes": (end, end + 1), "pursuit": (end,)}
    functions = [getattr(symbols, name) for name in outputs]
    codes = [Code(f, {0: 0, f.n_in() - 1: n}, at) for f, at in zip(functions, outputs.values(), strict=True)]
    numbers = np.ascontiguousarray(values, dtype=float)
    return Kernels(dict(zip(outputs, addresses(codes), strict=True)), numbers, tick_s, substeps)
