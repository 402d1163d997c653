"""The control model's step as machine code: by a C compiler where there is one, else by numba from CasADi's
instructions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.model.native import native_functions
from controller.model.symbols import Symbols
from models.compiled.cache import load
from models.compiled.python_source import statements

Array = NDArray[np.float64]

_FRAME = '''"""Generated from a CasADi function."""

import math

import numba
import numpy as np

FLAGS = {{"contract", "afn", "nsz"}}


@numba.njit(nogil=True, cache=True, error_model="numpy", fastmath=FLAGS)
def substep(state, c0, c1, d, t, h, parameters):
{unpack}
{step}
{store_step}


@numba.njit(nogil=True, cache=True, error_model="numpy", fastmath=FLAGS)
def slopes(state, c0, c1, d, t, h, parameters, J):
{unpack}
{slopes}
{store_slopes}


@numba.njit(nogil=True, cache=True, error_model="numpy", fastmath=FLAGS)
def aim(state, speed, d, t, parameters):
{unpack}
{pursuit}
    return {aim}


@numba.njit(nogil=True, cache=True, error_model="numpy", fastmath=FLAGS)
def hold(state, t, parameters, slope):
{unpack}
{wall}
{store_wall}
    return {force}


@numba.njit(nogil=True, cache=True, error_model="numpy")
def stage_on(state, command, after, d, t, h, substeps, parameters):
    rise = (after - command) / substeps
    for j in range(substeps):
        c0 = command + j * rise
        substep(state, c0, c0 + rise, d, t + j * h, h, parameters)


@numba.njit(nogil=True, cache=True, error_model="numpy")
def run(states, command, after, d, t, tick, substeps, parameters):
    for k in range(states.shape[0]):
        stage_on(states[k], command, after, d[k], t, tick / substeps, substeps, parameters)


@numba.njit(nogil=True, cache=True, error_model="numpy")
def run_each(states, command, after, d, t, tick, substeps, parameters, which, values):
    own = parameters.copy()
    for k in range(states.shape[0]):
        own[which] = values[k]
        stage_on(states[k], command, after, d[k], t, tick / substeps, substeps, own)


@numba.njit(nogil=True, cache=True, error_model="numpy")
def roll(path, commands, d, t, stage, substeps, parameters):
    h = stage / substeps
    for k in range(commands.shape[0] - 1):
        path[k + 1] = path[k]
        stage_on(path[k + 1], commands[k], commands[k + 1], d, t + k * stage, h, substeps, parameters)


@numba.njit(nogil=True, cache=True, error_model="numpy")
def pursue(path, commands, position, speed, catch, rate, low, high, d, t, stage, substeps, parameters):
    h = stage / substeps
    for k in range(commands.shape[0] - 1):
        wanted = speed[k + 1] + (position[k + 1] - path[k, 0]) / catch
        c = aim(path[k], wanted, d, t + k * stage, parameters)
        c = min(max(c, commands[k] - rate * stage), commands[k] + rate * stage)
        commands[k + 1] = min(max(c, low), high)
        path[k + 1] = path[k]
        stage_on(path[k + 1], commands[k], commands[k + 1], d, t + k * stage, h, substeps, parameters)


@numba.njit(nogil=True, cache=True, error_model="numpy")
def holds(path, forces, slopes, t, stage, parameters):
    for k in range(path.shape[0]):
        forces[k] = hold(path[k], t + k * stage, parameters, slopes[k])


@numba.njit(nogil=True, cache=True, error_model="numpy")
def linearise(path, A, B, commands, d, t, stage, substeps, parameters):
    n = path.shape[1]
    h = stage / substeps
    J = np.zeros((n, n + 3))
    S = np.zeros((n, n + 2))
    moved = np.zeros(n)
    for k in range(commands.shape[0] - 1):
        path[k + 1] = path[k]
        rise = (commands[k + 1] - commands[k]) / substeps
        S[:] = 0.0
        for i in range(n):
            S[i, i] = 1.0
        for j in range(substeps):
            c0 = commands[k] + j * rise
            slopes(path[k + 1], c0, c0 + rise, d, t + k * stage + j * h, h, parameters, J)
            first, last = j / substeps, (j + 1) / substeps
            for m in range(n + 2):
                for i in range(n):
                    moved[i] = 0.0
                    for l in range(n):
                        moved[i] += J[i, l] * S[l, m]
                for i in range(n):
                    S[i, m] = moved[i]
            for i in range(n):
                S[i, n] += J[i, n] * (1 - first) + J[i, n + 1] * (1 - last)
                S[i, n + 1] += J[i, n] * first + J[i, n + 1] * last
        A[k] = S[:, :n]
        B[k] = S[:, n:]
'''


@dataclass(frozen=True)
class Kernels:
    """Compiled functions of one model, `native` where a C compiler made them; arrays are C-contiguous float64, n
    states, all changed in place, nothing allocated but scratch.

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

    run: Any
    run_each: Any
    roll: Any
    linearise: Any
    pursue: Any
    holds: Any
    parameters: Array
    tick_s: float
    substeps: int
    native: bool = False

    def step(self, x: Array, command: float, disturbance_N: float, t: float) -> Array:
        """The state (n,) a tick later."""
        states = np.array(x, dtype=float).reshape(1, -1)
        self.run(states, command, command, np.array([disturbance_N]), t, self.tick_s, self.substeps, self.parameters)
        return np.asarray(states[0])

    def steps(self, states: Array, command: float, disturbance_N: Array, t: float) -> None:
        """Move `states` (m, n), each under its own disturbance (m,), a tick on, in place."""
        self.run(states, command, command, disturbance_N, t, self.tick_s, self.substeps, self.parameters)


def compile_kernels(symbols: Symbols, values: Array, tick_s: float, substeps: int) -> Kernels:
    """The functions of `symbols` at the parameters `values`; the code holds no parameter, so other values of the same
    model reuse it.
    """
    numbers, native = np.ascontiguousarray(values, dtype=float), native_functions(symbols)
    if native is not None:
        return Kernels(**native, parameters=numbers, tick_s=tick_s, substeps=substeps, native=True)
    m = load(_generated(symbols))
    return Kernels(m.run, m.run_each, m.roll, m.linearise, m.pursue, m.holds, numbers, tick_s, substeps)


def _generated(symbols: Symbols) -> str:
    """The source of numba's module."""
    n = len(symbols.states)
    names = _named(symbols, {(1, 0): "c0", (2, 0): "c1", (3, 0): "d", (4, 0): "t", (5, 0): "h"}, 6)
    step, stepped = statements(symbols.substep, names, "w")
    slope, sloped = statements(symbols.slopes, names, "w")
    wall, held = statements(symbols.wall_slopes, _named(symbols, {(1, 0): "t"}, 2), "w")
    pursuit, aimed = statements(symbols.pursuit, _named(symbols, {(1, 0): "speed", (2, 0): "d", (3, 0): "t"}, 4), "w")
    unpack = [f"s{i} = state[{i}]" for i in range(n)] + [
        f"p{i} = parameters[{i}]" for i in range(len(symbols.parameters))
    ]
    store = [f"state[{i}] = {sloped.get((0, i), '0.0')}" for i in range(n)]
    store += [f"J[{k % n}, {k // n}] = {sloped.get((1, k), '0.0')}" for k in range(n * (n + 3))]
    return _FRAME.format(
        unpack=_block(unpack),
        step=_block(step),
        store_step=_block([f"state[{i}] = {stepped.get((0, i), '0.0')}" for i in range(n)]),
        slopes=_block(slope),
        store_slopes=_block(store),
        pursuit=_block(pursuit),
        aim=aimed.get((0, 0), "0.0"),
        wall=_block(wall),
        store_wall=_block([f"slope[{i}] = {held.get((1, i), '0.0')}" for i in range(n)]),
        force=held.get((0, 0), "0.0"),
    )


def _named(symbols: Symbols, scalars: dict[tuple[int, int], str], parameters: int) -> dict[tuple[int, int], str]:
    """Names of a function's inputs: states first, `scalars`, the parameters as argument number `parameters`."""
    names = {(0, i): f"s{i}" for i in range(len(symbols.states))} | scalars
    return names | {(parameters, i): f"p{i}" for i in range(len(symbols.parameters))}


def _block(lines: list[str]) -> str:
    return "\n".join(f"    {line}" for line in lines)
