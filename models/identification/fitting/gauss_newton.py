"""Least squares on a jagged criterion: secants along the criterion's principal directions, trial steps side by side."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.compiled.residuals import products
from models.identification.kind import Array
from models.identification.settings import SET

Residuals = Callable[[Sequence[Array]], Array]
"""Residuals (P, m) at P points, a row each."""


@dataclass(frozen=True)
class Slope:
    """A point with its residuals (m,), and their derivatives at it or a step before: `along` (n, m) the directions
    whose inverse is `turned` (n, n). `normal` (n, n) and `gradient` (n,) are J'J and J'r.
    """

    x: Array
    residual: Array
    along: Array
    turned: Array
    normal: Array
    gradient: Array

    @property
    def cost(self) -> float:
        """Sum of squares."""
        return float(self.residual @ self.residual)

    @property
    def jacobian(self) -> Array:
        """Derivatives of the residuals (m, n), one column a parameter."""
        return np.asarray(self.along.T @ self.turned)


@dataclass(frozen=True)
class GaussNewton:
    """The problem: `residuals` of many points at once, bounds, `scale` of first secants."""

    residuals: Residuals
    lower: Array
    upper: Array
    scale: Array

    def minimum(self, start: Array, widths: Sequence[float], rounds: int) -> Slope:
        """Gauss-Newton from `start` in at most so many rounds; never ends higher than it began. The derivatives are
        those of the last round. In each round the residuals are evaluated on both sides along directions whose effects
        are orthogonal and of equal size, a width times `SET.secant_rms` of the residuals' unit rms. Narrower jags
        average out, and parameters that nearly compensate each other get long secants. Then steps of several lengths
        and dampings are tried at once and the lowest is taken. A width that no longer gains gives way to the next of
        `widths`; after the last the first follows again, as long as that gains.
        """
        x, number = start, 0
        r, reach = self._first_reach(x, widths[0])
        basis, began = np.diag(reach), float(r @ r)
        for _ in range(rounds):
            here, seen = self._slope(x, r, basis)
            steps, height = self._steps(here), here.cost
            x, r = min((x, r), seen, _lowest(steps, self.residuals(steps)), key=lambda one: float(one[1] @ one[1]))
            gain, last = height - float(r @ r), number == len(widths) - 1
            if last and gain <= SET.enough * height:
                if began - float(r @ r) <= SET.refines * began:
                    break
                number, began = 0, float(r @ r)  # a valley that bends is gone along with wide secants again
                _, reach = self._first_reach(x, widths[0])
                basis = np.diag(reach)
                continue
            number += not last and gain <= SET.refines * height
            wanted = SET.secant_rms * widths[number] * np.sqrt(len(r))
            norms = np.maximum(np.sqrt(np.maximum(np.diag(here.normal), 0.0)), SET.tiny)  # rounding may leave less
            reach = np.minimum(
                np.clip(wanted / norms, reach / SET.secant_change, reach * SET.secant_change), self._widest
            )
            basis = self._principal(here.normal, x, reach, wanted)
        return replace(here, x=x, residual=r)

    def _first_reach(self, x: Array, width: float) -> tuple[Array, Array]:
        """The residuals at `x`, and how far each parameter goes for the wanted effect, by a trial of its scale."""
        reach = np.minimum(width * self.scale, self._widest)
        up = np.where(x + reach <= self.upper, reach, -reach)
        r, *values = self.residuals([x, *(self.clip(x + step) for step in np.diag(up))])
        wanted = SET.secant_rms * width * np.sqrt(len(r))
        changes = np.array([np.linalg.norm(v - r) for v in values])
        times = np.clip(wanted / np.maximum(changes, SET.tiny), SET.secant_shrink, SET.secant_stretch)
        return r.copy(), np.minimum(reach * times, self._widest)

    def _slope(self, x: Array, r: Array, basis: Array) -> tuple[Slope, tuple[Array, Array]]:
        """Derivatives at `x` by secants along the columns of `basis`, and the lowest of the evaluated points."""
        n, steps = len(x), np.vstack([basis.T, -basis.T])
        ahead, sizes = np.where(steps > 0, self.upper - x, x - self.lower), np.abs(steps)
        room = np.divide(ahead, sizes, out=np.ones_like(steps), where=ahead < sizes)  # share that stays within bounds
        lengths = np.maximum(np.min(room, axis=1), 0.0)
        points = [self.clip(x + length * step) for length, step in zip(lengths, steps, strict=True)]
        rows, both = self.residuals(points), lengths[:n] + lengths[n:]
        along = np.asarray((rows[:n] - rows[n:]) / np.where(both > SET.tiny, both, np.inf)[:, None])
        turned = np.asarray(np.linalg.inv(basis), dtype=float)
        square = products(np.vstack([along, r]))
        normal, gradient = turned.T @ square[:-1, :-1] @ turned, turned.T @ square[:-1, -1]
        return Slope(x, r, along, turned, normal, gradient), _lowest(points, rows)

    def _steps(self, here: Slope) -> list[Array]:
        """Gauss-Newton steps of several lengths and dampings; a parameter that pushes against its bound stays there."""
        size = np.maximum(np.diag(here.normal), SET.tiny**2)
        edge, gradient = 2 * self._edge, here.gradient
        down, up = (here.x <= self.lower + edge) & (gradient > 0), (here.x >= self.upper - edge) & (gradient < 0)
        free = ~(down | up)
        block = np.ix_(free, free)
        points = []
        for damping, share in SET.trial_steps:
            step = np.zeros(len(here.x))
            step[free] = np.linalg.solve(here.normal[block] + damping * np.diag(size[free]), -gradient[free])
            points.append(self.clip(here.x + share * step))
        return points

    def _principal(self, normal: Array, x: Array, reach: Array, wanted: float) -> Array:
        """Directions, as columns, of orthogonal effects of one size; a parameter near a bound is one by itself."""
        basis = np.diag(reach)
        inner = np.flatnonzero(np.minimum(x - self.lower, self.upper - x) > SET.secant_near * reach)
        if len(inner):
            own = reach[inner]
            squares, turned = np.linalg.eigh(normal[np.ix_(inner, inner)] * np.outer(own, own))
            effects = np.sqrt(np.maximum(squares, 0.0))
            lengths = np.clip(wanted / np.maximum(effects, SET.tiny), SET.secant_shorter, SET.secant_longer)
            columns = own[:, None] * turned * lengths
            columns /= np.maximum(1.0, np.max(np.abs(columns) / self._widest[inner, None], axis=0))
            basis[np.ix_(inner, inner)] = columns
        return basis

    @property
    def _widest(self) -> Array:
        return np.asarray(SET.secant_share * (self.upper - self.lower))

    @property
    def _edge(self) -> Array:
        span = self.upper - self.lower
        return np.asarray(SET.inside * np.where(np.isfinite(span), span, 1.0))

    def clip(self, x: Array) -> Array:
        """`x` a little inside the bounds."""
        return np.clip(x, self.lower + self._edge, self.upper - self._edge)


def _lowest(points: Sequence[Array], rows: Array) -> tuple[Array, Array]:
    k = int(np.argmin(np.einsum("ij,ij->i", rows, rows)))
    return points[k], rows[k].copy()
