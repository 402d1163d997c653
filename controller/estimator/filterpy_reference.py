"""filterpy's filters on the same process: what the fast filters are tested against, and where filterpy's numerics are
tamed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.typing import NDArray

from controller.estimator.cubature_filter import CubatureFilter, Process
from controller.estimator.cubature_kernels import root

Array = NDArray[np.float64]


def safe_root(P: Array) -> Array:
    """Upper Cholesky factor (n, n) of `P`, symmetrised first and lifted where rounding made it indefinite: `P = U' U`.

    filterpy takes SciPy's Cholesky as it is, which raises for a covariance that lost its sign by rounding.
    """
    L = np.zeros_like(P)
    root(np.ascontiguousarray(0.5 * (P + P.T)), L)
    return L.T.copy()


class ReferenceFilter:
    """`UnscentedKalmanFilter` begun at `start`, with the points and weights of `Process`: 2 n points at `sqrt(n)`
    standard deviations, all of one weight.
    """

    def __init__(self, process: Process, start: CubatureFilter) -> None:
        n = process.size
        self._process, self._modes = process, start.modes.copy()
        self._command, self._time = start.command, start.time_s
        points = MerweScaledSigmaPoints(n, alpha=1.0, beta=0.0, kappa=0.0, sqrt_method=safe_root)
        self._own: Any = UnscentedKalmanFilter(n, 1, process.model.tick_s, lambda z: z[:1], self._move, points)
        self._own.x, self._own.P = start.z.copy(), start.P.copy()
        self._own.Q, self._own.R = np.diag(process.wander), np.array([[process.noise.position_std_m**2]])

    @property
    def z(self) -> Array:
        """The mean (n,)."""
        return np.asarray(self._own.x)

    @property
    def P(self) -> Array:
        """The covariance (n, n)."""
        return np.asarray(self._own.P)

    def _move(self, z: Array, dt: float) -> Array:
        new, _ = self._process.move(z, self._modes, *self._commands, self._time)
        return new

    def predict(self, command: float) -> None:
        """Move a tick on, to the end of which `command` leads."""
        process = self._process
        self._commands = (self._command, command)
        _, modes = process.move(self._own.x, self._modes, *self._commands, self._time)
        self._own.predict()
        self._own.P = 0.5 * (self._own.P + self._own.P.T)
        self._modes, self._command, self._time = modes, command, self._time + process.model.tick_s

    def see_position(self, value: float) -> None:
        """Take in a localisation. filterpy keeps the points of the prediction, which lack its noise: they are drawn
        anew first.
        """
        ukf = self._own
        ukf.sigmas_f = ukf.points_fn.sigma_points(ukf.x, ukf.P)
        ukf.update(np.array([value]))
        ukf.P = 0.5 * (ukf.P + ukf.P.T)
