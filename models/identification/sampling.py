"""Searches that look at many points at once, for criteria that stick-slip makes jagged: an ensemble's regression, an evolution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SHRINK = 3.0
_LEAP = 1.0
_NARROWEST = 1e-4
_PATIENCE = 10
_COLLAPSED = 0.3


@dataclass(frozen=True)
class Space:
    """Where to search: residuals of many points at once, bounds, each parameter's reach, about its uncertainty before the fit, and
    the values `home` that are believed before the fit."""

    residuals: Callable[[list[Array]], list[Array]]
    lower: Array
    upper: Array
    reach: Array
    home: Array

    def clip(self, x: Array) -> Array:
        return np.clip(x, self.lower, self.upper)


@dataclass
class Found:
    """The best point so far and its cost; `mean` and `root` (its columns, times the reach, span the spread) of the sampling."""

    best: Array
    cost: float
    mean: Array
    root: Array
    slope: Array

    def take(self, points: list[Array], costs: Array) -> None:
        i = int(np.argmin(costs))
        if costs[i] < self.cost:
            self.best, self.cost = points[i], float(costs[i])


def gather(
    space: Space, found: Found, rng: np.random.Generator, patience: tuple[float, float], rounds: int, widest: float
) -> Found:
    """Gauss-Newton on an ensemble: residuals regressed on parameters over a cloud of points, so that jags average out; samples that
    the regression cannot explain (teeth that come and go) weigh less; what is believed counts as much as the spread allows.

    The cloud's covariance is `patience` times that of least squares, from the first of its values down to the second as steps settle.
    """
    n, inflation, x, root = len(space.reach), patience[0], found.mean, found.root
    for _ in range(rounds):
        half = rng.standard_normal((n + 3, n))
        points = [x] + [space.clip(x + space.reach * (root @ z)) for z in np.vstack([half, -half])]
        values = np.array(space.residuals(points))
        found.take(points, np.einsum("ij,ij->i", values, values))
        design = np.column_stack([np.ones(len(points)), (np.array(points) - x) / space.reach])
        solved = np.linalg.lstsq(design, values, rcond=None)[0]
        left = values - design @ solved
        weight = 1 / (1 + np.einsum("ij,ij->j", left, left) / (len(points) - n - 1))
        slope = solved[1:]
        curvature = (slope * weight) @ slope.T
        gradient = (slope * weight) @ solved[0] / inflation + (x - space.home) / space.reach
        held = np.linalg.inv(root @ root.T + 1e-12 * np.eye(n)) / 4
        step = -np.linalg.solve(curvature / inflation + np.eye(n) + held, gradient)
        leap = float(np.linalg.norm(np.linalg.solve(root, step))) / np.sqrt(n)
        x = space.clip(x + space.reach * step)
        if leap < _LEAP:
            inflation /= _SHRINK
        root = spread(curvature, inflation, widest)
        found.slope = (slope / space.reach[:, None]).T
        if inflation < patience[1]:
            break
    found.mean, found.root = x, root
    found.take([x], np.array([float(r @ r) for r in space.residuals([x])]))
    return found


def spread(curvature: Array, inflation: float, widest: float) -> Array:
    """Root of `inflation` times the covariance that belongs to `curvature`, no axis beyond `widest`, all in reaches."""
    values, vectors = np.linalg.eigh(curvature / inflation + np.eye(len(curvature)))
    return np.asarray(vectors * np.clip(1 / np.sqrt(np.maximum(values, 1e-30)), _NARROWEST, widest))


def evolve(space: Space, found: Found, rng: np.random.Generator, rounds: int, sigma: float) -> Found:
    """CMA-ES (Hansen, arXiv:1604.00772) from `found.mean` with the spread `found.root`; starts anew from the best point
    where it collapses, until that gains nothing."""
    n = len(space.reach)
    size = 8 + int(3 * np.log(n))
    half = size // 2
    weight = np.log(half + 0.5) - np.log(np.arange(1, half + 1))
    weight /= weight.sum()
    mass = 1 / float(weight @ weight)
    c_path, c_size = (4 + mass / n) / (n + 4 + 2 * mass / n), (mass + 2) / (n + mass + 5)
    c_one = 2 / ((n + 1.3) ** 2 + mass)
    c_many = min(1 - c_one, 2 * (mass - 2 + 1 / mass) / ((n + 2) ** 2 + mass))
    damping = 1 + 2 * max(0.0, np.sqrt((mass - 1) / (n + 1)) - 1) + c_size
    expected = np.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n * n))
    x, covariance, path, turns, last, since = found.mean, np.eye(n), np.zeros(n), np.zeros(n), found.cost, 0
    begin, kept = sigma, np.inf
    for k in range(rounds):
        values, vectors = np.linalg.eigh(covariance)
        length = np.sqrt(np.maximum(values, 1e-20))
        moves = rng.standard_normal((size, n)) @ (vectors * length).T
        points = [space.clip(x + space.reach * (found.root @ (sigma * y))) for y in moves]
        costs = np.array([float(r @ r) for r in space.residuals(points)])
        found.take(points, costs)
        since = 0 if found.cost < 0.999 * last else since + 1
        last = found.cost if since == 0 else last
        if since > _PATIENCE and sigma < _COLLAPSED * begin:
            if found.cost >= 0.999 * kept:
                break
            x, covariance, path, turns, sigma, since, kept = found.best, np.eye(n), np.zeros(n), np.zeros(n), begin, 0, found.cost
            continue
        elite = moves[np.argsort(costs, kind="stable")[:half]]
        mean = weight @ elite
        x = space.clip(x + space.reach * (found.root @ (sigma * mean)))
        turns = (1 - c_size) * turns + np.sqrt(c_size * (2 - c_size) * mass) * ((vectors / length) @ vectors.T @ mean)
        norm = float(np.linalg.norm(turns))
        steady = norm / np.sqrt(1 - (1 - c_size) ** (2 * (k + 1))) < (1.4 + 2 / (n + 1)) * expected
        path = (1 - c_path) * path + steady * np.sqrt(c_path * (2 - c_path) * mass) * mean
        covariance = (1 - c_one - c_many) * covariance + c_one * np.outer(path, path) + c_many * (elite.T * weight) @ elite
        sigma *= float(np.exp(min(1.0, (c_size / damping) * (norm / expected - 1))))
    found.mean = x
    return found
