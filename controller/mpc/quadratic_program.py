"""The quadratic program of one SQP step in the rates of the command, and its solution by daqp."""

from __future__ import annotations

from dataclasses import dataclass

import daqp
import numpy as np
from numpy.typing import NDArray

from controller.mpc.condense import EXCESS, soft_rows
from controller.mpc.settings import Bounds

Array = NDArray[np.float64]

_ITERATIONS = 300
_FREE = 1e30


@dataclass(frozen=True)
class Program:
    """`min 1/2 y'Hy + f'y` over changes y of the N rates, in multiples of `unit`, and three slacks; holds its arrays, nothing is
    allocated in `solve` but what daqp returns. `penalty` (3,) is the price of the slacks of gap, speed, wall force, whose bounds are
    `soft` (3,)."""

    bounds: Bounds
    stages: int
    stage_s: float
    tick_s: float
    unit: float
    soft: Array
    penalty: Array
    H: Array
    f: Array
    rows: Array
    upper: Array
    lower: Array

    @classmethod
    def sized(
        cls, bounds: Bounds, stages: int, stage_s: float, tick_s: float, unit: float, soft: Array, penalty: Array
    ) -> Program:
        """With arrays for all rows that may come up."""
        n, most = stages + 3, 5 * stages
        H = np.eye(n)
        H[range(stages, n), range(stages, n)] = EXCESS * penalty
        f = np.concatenate([np.zeros(stages), penalty])
        arrays = (np.zeros((most, n)), np.zeros(n + most), np.zeros(n + most))
        return cls(bounds, stages, stage_s, tick_s, unit, soft, penalty, H, f, *arrays)

    def solve(self, path: Array, commands: Array, forces: Array, slopes: Array, Z: Array, last_rate: float) -> Array | None:
        """Changes (N,) of the rates, or None where daqp finds no finite solution; H and f must have been filled."""
        n, bend = self.stages, self.bounds.acceleration
        rates = np.diff(commands) / self.stage_s
        count = soft_rows(path, commands, forces, slopes, Z, self.unit * self.stage_s, self.soft, self.rows, self.upper[n + 3 :])
        size = n + 3 if count else n
        upper, lower = self.upper, self.lower
        if count:
            lower[size : size + count] = -_FREE
            upper[n:size], lower[n:size] = _FREE, 0.0
        top = size + count
        upper[:n], lower[:n] = (self.bounds.rate - rates) / self.unit, (-self.bounds.rate - rates) / self.unit
        if bend < _FREE:
            change = bend * self.tick_s
            upper[0] = min(upper[0], (last_rate + change - rates[0]) / self.unit)
            lower[0] = max(lower[0], (last_rate - change - rates[0]) / self.unit)
            steps, change = np.diff(rates), bend * self.stage_s
            block = self.rows[count : count + n - 1]
            block[:] = 0.0
            block[range(n - 1), range(n - 1)], block[range(n - 1), range(1, n)] = -1.0, 1.0
            upper[top : top + n - 1], lower[top : top + n - 1] = (change - steps) / self.unit, (-change - steps) / self.unit
            count, top = count + n - 1, top + n - 1
        reach = self.bounds.rate * n * self.stage_s
        if commands[0] + reach > self.bounds.high or commands[0] - reach < self.bounds.low:
            step = self.unit * self.stage_s
            self.rows[count : count + n] = 0.0
            self.rows[count : count + n, :n] = np.tri(n)
            upper[top : top + n] = (self.bounds.high - commands[1:]) / step
            lower[top : top + n] = (self.bounds.low - commands[1:]) / step
            count, top = count + n, top + n
        return _solved(self.H, self.f, self.rows[:count], upper[:top], lower[:top], size, n)


def _solved(H: Array, f: Array, rows: Array, upper: Array, lower: Array, size: int, n: int) -> Array | None:
    square, matrix = np.ascontiguousarray(H[:size, :size]), np.ascontiguousarray(rows[:, :size])
    lower = np.minimum(lower, upper)
    try:
        y, _, flag, _ = daqp.solve(square, f[:size], matrix, upper, lower, np.zeros(upper.size, np.intc), iter_limit=_ITERATIONS)
    except (ValueError, TypeError, ArithmeticError, MemoryError):
        return None
    y = np.asarray(y)[:n]
    return y if flag > 0 and bool(np.isfinite(y).all()) else None
