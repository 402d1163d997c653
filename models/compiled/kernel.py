"""A CasADi step function as a compiled NumPy loop: one declaration of the model, run at the speed of machine code."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from models.compiled.cache import load
from models.compiled.program import program_of

Array = NDArray[np.float64]
Loop = Callable[[Array, Array, Array, float, Array, int, float, Array], None]

LANES = 8
"""Parameter sets that a loop runs side by side: as many doubles as the widest vector units hold."""
SLOW_S = 2.0
NEVER_S = 1e30
"""`slow_s` of an observer that corrects all of the error: where nothing holds a place, a slow error is the model's own
drift.
"""
_WRITERS = ("arithmetic.py", "program.py")
_FRAME = '''"""Generated from a CasADi function; written out by {digest}."""

import numba
import numpy as np

from models.compiled.program import correction_program, step_program

step = step_program("""
{step}
""".strip(), {lanes})
correct = correction_program("""
{correct}
""".strip(), {lanes})


@numba.njit(nogil=True, cache=True, error_model="numpy")
def run(state, commands, measured, gain, parameters, substeps, dt, output):
    h = dt / substeps
    slow = np.zeros({lanes})
    work = np.concatenate((state.ravel(), parameters.ravel(), np.zeros({lanes})))
    for k in range(commands.shape[0]):
        c1 = commands[k]
        c0 = commands[k - 1] if k > 0 else c1
        for j in range(substeps if k > 0 else 1):
            a0 = c0 + (c1 - c0) * (j / substeps)
            a1 = c0 + (c1 - c0) * ((j + 1) / substeps)
            t = (k - 1) * dt + j * h if k > 0 else -h
            for lane in range({lanes}):
                step(work, lane, a0, a1, t, h)
        for lane in range({lanes}):
            output[k, lane] = work[{shown} + lane]
        if gain != 0.0:
            for lane in range({lanes}):
                e = measured[k, lane] - work[{shown} + lane]
                e = e if e == e else slow[lane]
                slow[lane] += min(dt / {forgets}, 1.0) * (e - slow[lane])
                correct(work, lane, e - slow[lane], gain)
    for i in range(state.shape[0]):
        for lane in range({lanes}):
            state[i, lane] = work[i * {lanes} + lane]
'''


@dataclass(frozen=True)
class Kernel:
    """A compiled loop over samples. `many(states, commands, measured, gain, parameters, substeps, dt, outputs)` runs
    `LANES` parameter sets side by side, a column each of `states` (n, LANES), `parameters` (m, LANES), `measured` and
    `outputs` (samples, LANES); `one` runs a single one, with the same numbers, on plain vectors.
    """

    step: ca.Function
    correct: ca.Function
    slow_s: float

    @cached_property
    def many(self) -> Loop:
        """The loop of `LANES` parameter sets, compiled when first asked for."""
        return self._compiled(LANES)

    def one(
        self,
        state: Array,
        commands: Array,
        measured: Array,
        gain: float,
        parameters: Array,
        substeps: int,
        dt: float,
        output: Array,
    ) -> None:
        """One parameter set; see `lower`."""
        self._single(
            state[:, None], commands, measured[:, None], gain, parameters[:, None], substeps, dt, output[:, None]
        )

    @cached_property
    def _single(self) -> Loop:
        return self._compiled(1)

    def _compiled(self, lanes: int) -> Loop:
        n, m = self.step.numel_in(0), self.step.numel_in(5)
        state = {(0, i): f"m{i}" for i in range(n)}
        names = state | {(5, i): f"m{n + i}" for i in range(m)} | {(1, 0): "a0", (2, 0): "a1", (3, 0): "t", (4, 0): "h"}
        text = _FRAME.format(
            digest=_digest(),
            step=program_of(self.step, names, state | {(1, 0): f"m{n + m}"}),
            correct=program_of(self.correct, state | {(1, 0): "e", (2, 0): "gain"}, state),
            lanes=lanes,
            shown=(n + m) * lanes,
            forgets=self.slow_s,
        )
        return load(text).run  # type: ignore[no-any-return]


def lower(step: ca.Function, correct: ca.Function, slow_s: float = SLOW_S) -> Kernel:
    """Compile `step(state, c0, c1, t, h, parameters) -> (state, output)` into a loop over samples, with `correct(state,
    error, gain)`.

    The loop steps through `commands` (one value a sample, linear in between, `substeps` steps a sample of `dt` s),
    overwrites `state` with the last one and fills `output`, one value a sample, predicted before the sample is seen.
    `correct` then moves the state by `gain` times the prediction's error less its slow part (a mean over about
    `slow_s`): an observer that keeps slip events in step and leaves alone what a model lacks slowly, and that runs free
    where `measured` is NaN; a gain of 0 runs free throughout and never looks at `measured`. Compiled when first run
    and kept on disk under the hash of its source. Running raises ValueError for operations that are not scalar.
    """
    return Kernel(step, correct, slow_s)


def _digest() -> str:
    """Hash of the files that write the machine code: numba's own cache does not look into them."""
    digest = hashlib.sha256()
    for name in _WRITERS:
        digest.update(Path(__file__).with_name(name).read_bytes())
    return digest.hexdigest()[:12]
