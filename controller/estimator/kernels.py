"""The filters' arithmetic as machine code: a root, cubature points, particles. Nothing here can fail."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from controller.signals import Array

Indices = NDArray[np.int64]
LEAST_SHARE = 1e-12  # of a variance: below it a pivot counts as rounding


@njit(cache=True)
def root(P: Array, L: Array) -> None:
    """Lower Cholesky factor `L` (n, n) of a symmetric `P` (n, n), whose lower half is read. A pivot too small by
    rounding becomes `LEAST_SHARE` of its diagonal, its column empty.
    """
    n = P.shape[0]
    for j in range(n):
        for i in range(j):
            L[i, j] = 0.0
        pivot = P[j, j]
        for k in range(j):
            pivot -= L[j, k] * L[j, k]
        least = LEAST_SHARE * abs(P[j, j]) + 1e-300
        sound = pivot > least
        L[j, j] = math.sqrt(pivot if sound else least)
        for i in range(j + 1, n):
            rest = P[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            L[i, j] = rest / L[j, j] if sound else 0.0


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
def expected(weights: Array, values: Array) -> tuple[float, float]:
    """Mean and variance of `values` (P,) under `weights` (P,); values of zero weight are ignored."""
    mean, square = 0.0, 0.0
    for k in range(weights.size):
        if weights[k] > 0:
            mean += weights[k] * values[k]
    for k in range(weights.size):
        if weights[k] > 0:
            square += weights[k] * (values[k] - mean) ** 2
    return mean, square


@njit(cache=True)
def weigh(weights: Array, values: Array, measured: float, variance: float) -> float:
    """Multiply `weights` (P,), in place, by the likelihood of `measured` for the expected `values` (P,) with noise of
    `variance`; returns the effective sample size `1/sum w^2`. A particle that is not a number gets zero weight.
    """
    least = math.inf
    for k in range(weights.size):
        off = (measured - values[k]) ** 2
        if weights[k] > 0 and off < least:
            least = off
    total = 0.0
    for k in range(weights.size):
        off = (measured - values[k]) ** 2
        weights[k] = weights[k] * math.exp(0.5 * (least - off) / variance) if weights[k] > 0 and off < math.inf else 0.0
        total += weights[k]
    square = 0.0
    for k in range(weights.size):
        weights[k] = weights[k] / total if total > 0 else 1.0 / weights.size
        square += weights[k] * weights[k]
    return 1.0 / square


@njit(cache=True)
def draw(weights: Array, share: float, chosen: Indices) -> None:
    """Systematic resampling: `chosen` (P,) gets each particle about P times its weight; `share` in [0, 1) begins."""
    n, k, total = weights.size, 0, weights[0]
    for i in range(n):
        while (i + share) / n > total and k < n - 1:
            k += 1
            total += weights[k]
        chosen[i] = k


@njit(cache=True)
def scatter(
    x: Array, level: Array, force: Array, brisk: Array, walks: Array, bounds: Array, normals: Array, chances: Array
) -> None:
    """Random walks of position, level and force of each particle (P,), in place. `walks`: standard deviations of
    position, calm level, brisk level and force, then the probability that a particle redraws whether it is `brisk` (1
    or 0). `normals` (3, P), `chances` (P,) uniform in [0, 1); the level stays within `bounds`.
    """
    for k in range(x.size):
        if chances[k] < walks[4]:
            brisk[k] = 1.0 if chances[k] < 0.5 * walks[4] else 0.0
        x[k] += walks[0] * normals[0, k]
        step = walks[2] if brisk[k] > 0 else walks[1]
        level[k] = min(max(level[k] + step * normals[1, k], bounds[0]), bounds[1])
        force[k] += walks[3] * normals[2, k]


@njit(cache=True)
def survey(weights: Array, states: Array, level: Array, force: Array, mean: Array, std: Array) -> tuple[float, float]:
    """Fill `mean` and `std` (n,) with those of `states` (P, n); returns the means of `level` and `force` (P,)."""
    mean[:], std[:] = 0.0, 0.0
    levels, forces = 0.0, 0.0
    for k in range(weights.size):
        w = weights[k]
        if w > 0:
            levels, forces = levels + w * level[k], forces + w * force[k]
            for i in range(mean.size):
                mean[i] += w * states[k, i]
    for k in range(weights.size):
        if weights[k] > 0:
            for i in range(mean.size):
                std[i] += weights[k] * (states[k, i] - mean[i]) ** 2
    for i in range(mean.size):
        std[i] = math.sqrt(std[i])
    return levels, forces


@njit(cache=True)
def led(
    weights: Array,
    states: Array,
    level: Array,
    wall: int,
    mean: Array,
    std: Array,
    mean_level: float,
    far: Array,
    leader: int,
) -> int:
    """The leading particle: `leader` (-1: none) as long as its position, level and wall (the state `wall`) are within
    `far` (3,) standard deviations of the mean, else the particle nearest to the mean in these.
    """
    spread = 0.0
    for k in range(weights.size):
        if weights[k] > 0:
            spread += weights[k] * (level[k] - mean_level) ** 2
    if leader >= 0:
        near = (
            abs(states[leader, 0] - mean[0]) <= far[0] * std[0]
            and abs(states[leader, wall] - mean[wall]) <= far[2] * std[wall]
        )
        if near and (level[leader] - mean_level) ** 2 <= far[1] ** 2 * spread:
            return leader
    best, found = math.inf, 0
    for k in range(weights.size):
        off = (states[k, 0] - mean[0]) ** 2 / (std[0] ** 2 + 1e-300) + (level[k] - mean_level) ** 2 / (spread + 1e-300)
        off += (states[k, wall] - mean[wall]) ** 2 / (std[wall] ** 2 + 1e-300)
        if weights[k] > 0 and off < best:
            best, found = off, k
    return found
