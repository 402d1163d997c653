"""A fast Gaussian filter by cubature points, compiled: of an inner mass whose readings come late."""

import math
from typing import ClassVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from controller.estimator import gaussian
from controller.estimator.gaussian import Belief, GaussianEstimator
from controller.estimator.kernels import root
from controller.model.control_model import ControlModel
from controller.signals import Array
from controller.tuned import FilterNoise
from models.parameter import Name

Indices = NDArray[np.int64]


@njit(cache=True)
def place_points(
    z: Array,
    P: Array,
    modes: Array,
    where: Indices,
    scale: float,
    bounds: Array,
    L: Array,
    states: Array,
    d: Array,
    level: Array,
    learned: Array,
) -> None:
    """Fill `states` (2 n + 1, model states), `d` and `level` (2 n + 1,) with the points `z`, `z +- scale L_j` of the
    estimate `z` (n,), `P`: the continuous states at `where`, disturbance and level; switches are `modes`. `bounds`
    (3,): least and greatest level, the learned parameter at level 0. `learned` (2 n + 1,) becomes its value at each
    level.
    """
    root(P, L)
    n = z.shape[0]
    for m in range(2 * n + 1):
        for i in range(modes.shape[0]):
            states[m, i] = modes[i]
        side = 0.0 if m == 0 else (scale if m % 2 == 1 else -scale)
        column = (m - 1) // 2
        for i in range(n):
            value = z[i] + (side * L[i, column] if m > 0 else 0.0)
            if i < n - 2:
                states[m, where[i]] = value
            elif i == n - 2:
                d[m] = value
            else:
                level[m] = min(max(value, bounds[0]), bounds[1])
                learned[m] = (1 + level[m]) * bounds[2]


@njit(cache=True)
def take_moments(
    states: Array, d: Array, level: Array, where: Indices, scale: float, Q: Array, z: Array, P: Array, modes: Array
) -> None:
    """The estimate after the prediction: the mean `z` (n,) of the outer points, `P = sum (p - z)(p - z)' / (2 scale^2)`
    plus the step's noise `Q` (n,), `modes` of the middle point. The weights of cubature are positive, so `P` stays
    positive.
    """
    n = z.shape[0]
    points = np.empty((2 * n + 1, n))
    for m in range(2 * n + 1):
        for i in range(n - 2):
            points[m, i] = states[m, where[i]]
        points[m, n - 2], points[m, n - 1] = d[m], level[m]
    for i in range(n):
        total = 0.0
        for m in range(1, 2 * n + 1):
            total += points[m, i]
        z[i] = total / (2 * n)
    for i in range(modes.shape[0]):
        modes[i] = states[0, i]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for m in range(1, 2 * n + 1):
                total += (points[m, i] - z[i]) * (points[m, j] - z[j])
            P[i, j] = total / (2 * scale * scale)
            P[j, i] = P[i, j]
    for i in range(n):
        P[i, i] += Q[i]


@njit(cache=True)
def fuse(z: Array, P: Array, H: Array, difference: float, R: float, gate: float, K: Array) -> float:
    """Use, in place, `difference` = measured - expected with slopes `H` (n,) and variance `R`; returns the normalised
    `|difference|/sqrt(H P H' + R)`. Beyond `gate`, or not a number, nothing changes. Joseph's form.
    """
    n = z.shape[0]
    S = R
    for i in range(n):
        K[i] = 0.0
        for j in range(n):
            K[i] += P[i, j] * H[j]
        S += H[i] * K[i]
    size = abs(difference) / math.sqrt(S) if S > 0 else math.inf
    if not size <= gate:
        return size
    for i in range(n):
        K[i] /= S
        z[i] += K[i] * difference
    for column in range(n):  # (I - K H) P
        along = 0.0
        for j in range(n):
            along += H[j] * P[j, column]
        for i in range(n):
            P[i, column] -= K[i] * along
    for row in range(n):  # ... (I - K H)' + K R K'
        along = 0.0
        for j in range(n):
            along += P[row, j] * H[j]
        for i in range(n):
            P[row, i] += K[i] * (R * K[row] - along)
    for i in range(n):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])
    return size


class Process(gaussian.Process):
    """The control model by its points."""

    def __init__(self, model: ControlModel, noise: FilterNoise) -> None:
        super().__init__(model, noise)
        n = len(self.names)
        self._scale = math.sqrt(n)
        self._bounds = np.array([self.level.low, self.level.high, self.level.middle])
        self._states = np.zeros((2 * n + 1, len(model.states)))
        self._d, self._level, self._values = (np.zeros(2 * n + 1) for _ in range(3))
        self._which = np.array([self.level.index])
        self._L, self._K, self._H = np.zeros((n, n)), np.zeros(n), np.zeros(n)

    def predict(self, b: Belief, command: float) -> None:
        k, points = self.model.kernels, (self._states, self._d, self._level)
        place_points(b.z, b.P, b.modes, self.where, self._scale, self._bounds, self._L, *points, self._values)
        before = self.model.command_from(b.command, command)
        moved = (self._states, before, command, self._d, b.time_s, k.tick_s, k.substeps, k.parameters)
        k.run_each(self._which, self._values[None, :], *moved)
        take_moments(*points, self.where, self._scale, self._noise_of(b), b.z, b.P, b.modes)
        b.time_s += k.tick_s
        b.command = command

    def see(self, b: Belief, value: float, state: Name | None = None) -> float:
        std = self.noise.position_std_m if state is None else self.noise.feedback_std
        row = 0 if state is None else self.names.index(state)
        expected, self._H[:] = b.z[row], 0.0
        if self._plain or state is not None:
            self._H[row] = 1.0
        else:
            shown, slopes = self._seen(self.state(b), b.time_s)
            expected = float(shown)
            self._H[:-2] = np.asarray(slopes).ravel()[self.where]
        off = value - expected
        size = math.copysign(float(fuse(b.z, b.P, self._H, off, std**2, self.noise.gate, self._K)), off)
        if state is None and abs(size) <= self.noise.gate:
            b.surprise = self.noise.surprised(b.surprise, size)
        return size


class CubatureEstimator(GaussianEstimator):
    """A cubature Kalman filter."""

    process: ClassVar[type[gaussian.Process]] = Process
