"""filterpy's extended filter on the same process: what the fast filter of a magnetic rig is tested against."""

from __future__ import annotations

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

from controller.estimator.belief import NARROW, Belief, Process
from controller.estimator.reference_ukf import safe_root

Array = NDArray[np.float64]


class ReferenceExtended:
    """`ExtendedKalmanFilter` with the slopes of `Process`: central differences over `NARROW` standard deviations along the axes of P."""

    def __init__(self, process: Process, start: Belief) -> None:
        self._process, self._modes = process, start.modes.copy()
        self._command, self._time = start.command, start.time_s
        self._ekf = ExtendedKalmanFilter(process.size, 1)
        self._ekf.x, self._ekf.P = start.z.copy(), start.P.copy()
        self._ekf.Q, self._ekf.R = np.diag(process.wander), np.array([[process.noise.position_std_m**2]])

    @property
    def z(self) -> Array:
        """The mean (n,)."""
        return np.asarray(self._ekf.x)

    @property
    def P(self) -> Array:
        """The covariance (n, n)."""
        return np.asarray(self._ekf.P)

    def predict(self, command: float) -> None:
        """Move a tick on, to the end of which `command` leads."""
        process, ekf = self._process, self._ekf
        middle = process.middle(self._command, command)

        def moved(z: Array) -> Array:
            return process.move(z, self._modes, middle, self._time)[0]

        axes = safe_root(ekf.P)
        slopes = [(moved(ekf.x + NARROW * axis) - moved(ekf.x - NARROW * axis)) / (2 * NARROW) for axis in axes]
        after, modes = process.move(ekf.x, self._modes, middle, self._time)
        ekf.F = np.linalg.solve(axes, np.array(slopes)).T
        ekf.predict()
        ekf.x = after
        self._modes, self._command, self._time = modes, command, self._time + process.model.tick_s

    def see_position(self, value: float) -> None:
        """Take in a localisation."""
        self._ekf.update(np.array([value]), lambda z: np.eye(1, z.size), lambda z: z[:1])
