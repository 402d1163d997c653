"""The quadratic program of one SQP step in the rates of the command, and its solution by daqp."""

from __future__ import annotations

from dataclasses import dataclass

import daqp
import numpy as np
from numpy.typing import NDArray

from controller.mpc.condense import EXCESS
from controller.mpc.rows import FREE, hard_rows, soft_rows

Array = NDArray[np.float64]

_ITERATIONS = 300  # of the active set, before a program counts as unsolved


@dataclass(frozen=True)
class Program:
    """`min 1/2 y'Hy + f'y` over changes y of the N rates, in multiples of `unit`, and three slacks; holds its arrays.

    `hard` holds low, high, rate, acceleration, `soft` (3,) the bounds of gap, speed and wall force, `penalty` (3,) what
    their slacks cost. H and f are filled from outside, their leading N entries.
    """

    stages: int
    stage_s: float
    tick_s: float
    unit: float
    hard: Array
    soft: Array
    H: Array
    f: Array
    rows: Array
    upper: Array
    lower: Array

    @classmethod
    def sized(
        cls, stages: int, stage_s: float, tick_s: float, unit: float, hard: Array, soft: Array, penalty: Array
    ) -> Program:
        """With arrays for all rows that may come up."""
        n, most = stages + 3, 5 * stages
        H = np.eye(n)
        H[range(stages, n), range(stages, n)] = EXCESS * penalty
        f = np.concatenate([np.zeros(stages), penalty])
        arrays = (np.zeros((most, n)), np.zeros(n + most), np.zeros(n + most))
        return cls(stages, stage_s, tick_s, unit, hard, soft, H, f, *arrays)

    def solve(
        self, path: Array, commands: Array, forces: Array, slopes: Array, Z: Array, last_rate: float
    ) -> Array | None:
        """Changes (N,) of the rates, or None where daqp finds no finite solution. The changes may break an acceleration
        or range that the plan before was far from.
        """
        n, upper, lower = self.stages, self.upper, self.lower
        count = soft_rows(
            path, commands, forces, slopes, Z, self.unit * self.stage_s, self.soft, self.rows, upper[n + 3 :]
        )
        size = n + 3 if count else n
        upper[n:size], lower[n:size] = FREE, 0.0
        lower[size : size + count] = -FREE
        pace = (last_rate, self.stage_s, self.tick_s, self.unit, self.hard)
        count = hard_rows(commands, *pace, self.rows, upper, lower, size, count)
        top = size + count
        H, rows = (self.H, self.rows[:count]) if size > n else (self.H[:n, :n].copy(), self.rows[:count, :n].copy())
        try:
            y, _, flag, _ = daqp.solve(H, self.f[:size], rows, upper[:top], lower[:top], None, iter_limit=_ITERATIONS)
        except (ValueError, TypeError, ArithmeticError, MemoryError):
            return None
        change: Array = np.asarray(y)[:n]
        return change if flag > 0 and np.isfinite(change.sum()) else None
