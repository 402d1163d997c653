"""Runs of a model whose command is on for a part of each period, from rest: their mean speeds, at machine code's."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from models.assembly.model import BASE_STATES, Assembly
from models.compiled.kernel import LANES
from models.compiled.machine_code import Code, addresses, call
from models.parameter import Name

Array = NDArray[np.float64]
STEP_S = 3e-4
"""Longest step: mean speeds of a capsubot are within 0.1 mm/s of those with steps of 10 us."""
_PERIODIC = 1e-6  # change of the states over a period, SI, below which the motion is periodic


@njit(nogil=True, cache=True, error_model="numpy")
def _run(code: int, work: Array, runs: Array, steps: int, watched: Array, n: int, speeds: Array) -> None:
    lanes, shared, begun = runs.shape[1], np.zeros(1), np.zeros(len(work))
    period, duty, cycles = runs
    on = np.zeros(lanes)  # steps of each period with the command on; switching edges lie between steps
    for lane in range(lanes):
        on[lane] = max(round(duty[lane] * steps), np.ceil(duty[lane]))
        on[lane] = min(on[lane], steps - np.ceil(1.0 - duty[lane]))
    for cycle in range(cycles.max()):
        for i in range(n * lanes):
            begun[i] = work[i]
        for k in range(steps):
            for lane in range(lanes):
                command = 1.0 if k < on[lane] else 0.0
                share = duty[lane] / on[lane] if k < on[lane] else (1.0 - duty[lane]) / (steps - on[lane])
                work[-5 * lanes + lane] = work[-4 * lanes + lane] = command
                work[-2 * lanes + lane] = share * period[lane]
            call(code, work, shared)
        going = 0
        for lane in range(lanes):
            if np.isnan(speeds[lane]):
                change = 0.0
                for i in watched:
                    change = max(change, abs(work[i * lanes + lane] - begun[i * lanes + lane]))
                if change < _PERIODIC or cycle + 1 >= cycles[lane]:
                    rest = (work[lane] - begun[lane]) * (cycles[lane] - 1 - cycle)
                    speeds[lane] = (work[lane] + rest) / (cycles[lane] * period[lane])
                else:
                    going += 1
        if going == 0:
            return


@dataclass(frozen=True)
class Cycles:
    """`assembly` from rest, `LANES` runs side by side; periods that repeat the one before are not stepped through."""

    assembly: Assembly

    @cached_property
    def _code(self) -> int:
        step, n, m = self.assembly.step, len(self.assembly.states), len(self.assembly.parameters)
        inputs = {0: 0, 5: n} | {k: n + m + k - 1 for k in range(1, 5)}
        return addresses([Code(step, inputs, (0, n + m + 4))], LANES)[0]

    def speeds(self, runs: Array, values: Mapping[Name, float], step_s: float = STEP_S) -> Array:
        """Mean speed of the body in m/s (k,) over `runs` (k, 3): period in s, duty, cycles; at `values` by name."""
        states = self.assembly.states
        watched = np.array([k for k, name in enumerate(states) if name == "v" or name not in BASE_STATES])
        start = np.concatenate([self.assembly.start(), self.assembly.vector(values), np.zeros(5)])
        found, order = np.empty(len(runs)), np.argsort(runs[:, 0], kind="stable")
        for rows in np.split(order, range(LANES, len(order), LANES)):
            some = np.ascontiguousarray(runs[np.resize(rows, LANES)].T)
            work, speeds = np.repeat(start, LANES), np.full(LANES, np.nan)
            _run(self._code, work, some, max(int(np.ceil(some[0].max() / step_s)), 2), watched, len(states), speeds)
            found[rows] = speeds[: len(rows)]
        return found
