"""A CasADi step function as a compiled NumPy loop: one declaration of the model, run at the speed of machine code."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import casadi as ca
import numpy as np
from numba import njit
from numpy.typing import NDArray

from models.compiled.machine_code import Code, addresses, call

Array = NDArray[np.float64]
Loop = Callable[[Array, Array, Array, float, Array, int, float, Array, float], None]
Alone = Callable[[Array, Array, Array, float, Array, int, float, Array], None]

LANES = 8
"""Parameter sets that a loop runs side by side: as many doubles as the widest vector units hold."""
SLOW_S = 2.0  # time constant within which an observer leaves an error alone
NEVER_S = 1e30
"""`slow_s` of an observer that corrects the whole error: a slow error is then the model's own drift."""


@njit(nogil=True, cache=True, error_model="numpy")
def _run(
    codes: tuple[int, ...],
    forgets: float,
    state: Array,
    commands: Array,
    measured: Array,
    gain: float,
    parameters: Array,
    substeps: int,
    dt: float,
    output: Array,
    began: float,
) -> None:
    step, correct = codes
    n, lanes = state.shape
    m, h = parameters.shape[0], dt / substeps
    work = np.zeros((n + m + 1) * lanes + output.shape[1])
    for lane in range(lanes):  # slices' assignment takes numba seconds to compile
        for i in range(n):
            work[i * lanes + lane] = state[i, lane]
        for i in range(m):
            work[(n + i) * lanes + lane] = parameters[i, lane]
    shown, error = work[(n + m) * lanes : -lanes], work[-lanes:]
    slow, now, gains = np.zeros(lanes), np.zeros(4), np.full(1, gain)
    for k in range(commands.shape[0]):
        c1 = commands[k]
        c0 = commands[k - 1] if k > 0 else c1
        for j in range(substeps if k > 0 else 1):
            now[0] = c0 + (c1 - c0) * (j / substeps)
            now[1] = c0 + (c1 - c0) * ((j + 1) / substeps)
            now[2] = began + (k - 1) * dt + j * h if k > 0 else -h  # before the start a filter has no past
            now[3] = h
            call(step, work, now)
        for lane in range(output.shape[1]):
            output[k, lane] = shown[lane]
        if gain != 0.0:
            for lane in range(lanes):
                e = measured[k, lane] - shown[lane]
                e = e if e == e else slow[lane]
                slow[lane] += min(dt / forgets, 1.0) * (e - slow[lane])
                error[lane] = e - slow[lane]
            call(correct, work, gains)
    for lane in range(lanes):
        for i in range(n):
            state[i, lane] = work[i * lanes + lane]


@dataclass(frozen=True)
class Kernel:
    """`step(state, c0, c1, t, h, parameters) -> (state, output)` and `correct(state, error, gain)` as a compiled loop
    over samples. `many(states, commands, measured, gain, parameters, substeps, dt, outputs, began)` runs `LANES`
    parameter sets side by side, a column each of `states` (n, LANES), `parameters` (m, LANES), `measured` and `outputs`
    (samples, LANES a row of the output), from the time `began` in s; `one` runs a single set from 0, with the same
    numbers, on plain vectors.

    The loop steps through `commands` (one value a sample, linear in between, `substeps` steps a sample of `dt` s),
    overwrites `states` with the last ones and fills `outputs`, each predicted before its sample is seen. `correct` then
    moves the state by `gain` times the prediction's error less its slow part (a mean over about `slow_s`): an observer
    that keeps slip events in step without hiding slow errors of the model. It runs free where `measured` is NaN, and
    throughout at a gain of 0. Compiled when first run and kept on disk. Running raises ValueError for operations that
    are not scalar.
    """

    step: ca.Function
    correct: ca.Function
    slow_s: float = SLOW_S

    @cached_property
    def many(self) -> Loop:
        return self._compiled(LANES)

    @cached_property
    def one(self) -> Alone:
        run = self._compiled(1)
        return lambda state, commands, measured, gain, parameters, substeps, dt, output: run(
            state[:, None], commands, measured[:, None], gain, parameters[:, None], substeps, dt, output[:, None], 0.0
        )

    def _compiled(self, lanes: int) -> Loop:
        n, m, rows = self.step.numel_in(0), self.step.numel_in(5), self.step.numel_out(1)
        codes = (Code(self.step, {0: 0, 5: n}, (0, n + m)), Code(self.correct, {0: 0, 1: n + m + rows}, (0,)))
        return partial(_run, addresses(codes, lanes), self.slow_s)
