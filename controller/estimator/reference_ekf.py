"""filterpy's extended filter on the same process: what the fast filter of a magnetic rig is tested against."""

from __future__ import annotations

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

from controller.estimator.belief import NARROW, Belief, Process
from controller.estimator.reference_ukf import Reference, safe_root

Array = NDArray[np.float64]


class ReferenceExtended(Reference):
    """`ExtendedKalmanFilter` with the slopes of `Process`: central differences over `NARROW` standard deviations along the axes of P."""

    def __init__(self, process: Process, start: Belief) -> None:
        super().__init__(process, start, ExtendedKalmanFilter(process.size, 1))

    def predict(self, command: float) -> None:
        """Move a tick on, to the end of which `command` leads."""
        process, ekf = self._process, self._own
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
        self._own.update(np.array([value]), lambda z: np.eye(1, z.size), lambda z: z[:1])
