"""Least squares on a jagged criterion: secants along the criterion's principal directions, trial steps side by side."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from models.identification.kind import Array
from models.identification.settings import SET

Point = tuple[Array, Array]
"""A point and its residuals."""

_STEPS = (
    (1e-6, 1.0),
    (1e-6, 0.5),
    (1e-2, 1.0),
    (0.1, 1.0),
    (1e-6, 2.0),
    (1e-6, 0.25),
    (1e-3, 1.0),
    (1e-3, 0.4),
    (1e-2, 0.4),
    (0.1, 0.4),
    (1.0, 1.0),
    (1.0, 0.4),
    (10.0, 1.0),
    (10.0, 0.4),
)  # damping and share of a Gauss-Newton step, likeliest first
_TINY = 1e-12  # change of the residuals that is none


@dataclass(frozen=True)
class Slope:
    """A point with its residuals, and their derivatives at it or a step before, one column a parameter."""

    x: Array
    residual: Array
    jacobian: Array

    @property
    def cost(self) -> float:
        """Sum of squares."""
        return float(self.residual @ self.residual)


@dataclass(frozen=True)
class GaussNewton:
    """The problem: `residuals` of many points at once, bounds, `scale` of first secants, trial steps in a `batch`."""

    residuals: Callable[[list[Array]], list[Array]]
    lower: Array
    upper: Array
    scale: Array
    batch: int = 16

    def descend(self, start: Array, secant: float, rounds: int) -> Slope:
        """Gauss-Newton from `start` in one round or more; never ends higher than it began. The derivatives are those of
        the last round.

        In each round the residuals are evaluated on both sides along directions whose effects are orthogonal and of
        equal size, `secant` times `SET.secant_rms` of the residuals' unit rms. Narrower jags average out, and
        parameters that nearly compensate each other get long secants. Then steps of several lengths and dampings are
        tried at once and the lowest is taken.
        """
        x = start
        r, reach = self._first_reach(x, secant)
        wanted = SET.secant_rms * secant * np.sqrt(len(r))
        basis = np.diag(reach)
        for _ in range(rounds):
            here, seen = self._slope(x, r, basis)
            x, r = self._lowest(here, seen)
            gain = here.cost - float(r @ r)
            if gain <= 0:
                return here
            if gain < SET.enough * here.cost:
                break
            norms = np.maximum(np.linalg.norm(here.jacobian, axis=0), _TINY)
            reach = self._limited(np.clip(wanted / norms, reach / 3, reach * 3))
            basis = self._principal(here.jacobian, x, reach, wanted)
        return Slope(x, r, here.jacobian)

    def _lowest(self, here: Slope, seen: Point) -> Point:
        """The lowest of `seen` and of the trial steps, up to the first batch that gains enough; `here` where none is
        lower.
        """
        steps, best = self._steps(here), min((here.x, here.residual), seen, key=_height)
        for first in range(-1, len(steps), self.batch):
            some = steps[max(first, 0) : first + self.batch]
            best = min(best, *zip(some, self.residuals(some), strict=True), key=_height)
            if here.cost - _height(best) > SET.enough * here.cost:
                break
        return best

    def _first_reach(self, x: Array, secant: float) -> tuple[Array, Array]:
        """The residuals at `x`, and how far each parameter goes for the wanted effect, by a trial of its scale."""
        reach = self._limited(secant * self.scale)
        up = np.where(x + reach <= self.upper, reach, -reach)
        r, *values = self.residuals([x, *(self.clip(x + step) for step in np.diag(up))])
        wanted = SET.secant_rms * secant * np.sqrt(len(r))
        changes = np.array([np.linalg.norm(v - r) for v in values])
        return r, self._limited(reach * np.clip(wanted / np.maximum(changes, _TINY), 0.1, SET.secant_stretch))

    def _slope(self, x: Array, r: Array, basis: Array) -> tuple[Slope, Point]:
        """Derivatives at `x` by secants along the columns of `basis`, and the lowest of the evaluated points."""
        points, lengths = [], []
        for direction in basis.T:
            for step in (direction, -direction):
                share = self._room(x, step)
                points.append(self.clip(x + share * step))
                lengths.append(share)
        values = self.residuals(points)
        both = np.array(lengths[::2]) + np.array(lengths[1::2])
        along = [
            (up - down) / b if b > _TINY else np.zeros(len(r))
            for up, down, b in zip(values[::2], values[1::2], both, strict=True)
        ]
        jacobian = np.array(along).T @ np.linalg.inv(basis)
        return Slope(x, r, jacobian), min(zip(points, values, strict=True), key=_height)

    def _steps(self, here: Slope) -> list[Array]:
        """Gauss-Newton steps of several lengths and dampings; a parameter that pushes against its bound stays there."""
        gradient = here.jacobian.T @ here.residual
        curvature = here.jacobian.T @ here.jacobian
        size = np.maximum(np.diag(curvature), 1e-30)
        edge = self._edge()
        free = ~(
            ((here.x <= self.lower + 2 * edge) & (gradient > 0)) | ((here.x >= self.upper - 2 * edge) & (gradient < 0))
        )
        block = np.ix_(free, free)
        points = []
        for damping, share in _STEPS:
            step = np.zeros(len(here.x))
            step[free] = np.linalg.solve(curvature[block] + damping * np.diag(size[free]), -gradient[free])
            points.append(self.clip(here.x + share * step))
        return points

    def _principal(self, jacobian: Array, x: Array, reach: Array, wanted: float) -> Array:
        """Directions, as columns, of orthogonal effects of one size; a parameter near a bound is one by itself."""
        basis = np.diag(reach)
        inner = np.flatnonzero(np.minimum(x - self.lower, self.upper - x) > SET.secant_near * reach)
        if len(inner):
            _, effects, turned = np.linalg.svd(jacobian[:, inner] * reach[inner], full_matrices=False)
            if len(effects) == len(inner):
                lengths = np.clip(wanted / np.maximum(effects, _TINY), SET.secant_shorter, SET.secant_longer)
                columns = reach[inner, None] * turned.T * lengths
                columns /= np.maximum(1.0, np.max(np.abs(columns) / self._widest()[inner, None], axis=0))
                basis[np.ix_(inner, inner)] = columns
        return basis

    def _widest(self) -> Array:
        span = self.upper - self.lower
        return np.where(np.isfinite(span), SET.secant_share * span, np.inf)

    def _limited(self, reach: Array) -> Array:
        return np.asarray(np.minimum(reach, self._widest()))

    def _edge(self) -> Array:
        span = self.upper - self.lower
        return np.where(np.isfinite(span), span, 1.0) * 1e-9

    def clip(self, x: Array) -> Array:
        """`x` a little inside the bounds."""
        edge = self._edge()
        return np.clip(x, self.lower + edge, self.upper - edge)

    def _room(self, x: Array, step: Array) -> float:
        """The share of `step` that stays within the bounds."""
        ahead = np.where(step > 0, self.upper - x, x - self.lower)
        moving = step != 0
        return float(np.clip(np.min(ahead[moving] / np.abs(step[moving]), initial=1.0), 0.0, 1.0))


def _height(point: Point) -> float:
    return float(point[1] @ point[1])
