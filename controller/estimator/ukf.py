"""filterpy's unscented filter on the same process: selectable, and the reference of the fast filters' tests."""

import math
from typing import Any, ClassVar

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from controller.estimator.cubature import Belief, CubatureEstimator, Process
from controller.estimator.kernels import root
from controller.model.control_model import ControlModel
from controller.signals import Array
from controller.tuned import FilterNoise


def safe_root(P: Array) -> Array:
    """Upper Cholesky factor of `P`, lifted where rounding made it indefinite, for which SciPy's would raise."""
    L = np.zeros_like(P)
    root(np.ascontiguousarray(0.5 * (P + P.T)), L)
    return L.T.copy()


class FilterpyProcess(Process):
    """`Process` by filterpy: 2 n points at `sqrt(n)` standard deviations, all of one weight."""

    def __init__(self, model: ControlModel, noise: FilterNoise) -> None:
        super().__init__(model, noise)
        n = len(self.names)
        points = MerweScaledSigmaPoints(n, alpha=1.0, beta=0.0, kappa=0.0, sqrt_method=safe_root)
        self._ukf: Any = UnscentedKalmanFilter(n, 1, model.tick_s, None, self._moved, points)

    def _move(self, b: Belief, before: float, command: float) -> None:
        ukf = self._ukf
        ukf.x, ukf.P, ukf.Q = b.z.copy(), b.P.copy(), np.diag(self._walk)
        self._from = (b.modes.copy(), before, command, b.time_s)
        b.modes[:] = self._moved_state(b.z)
        ukf.predict()
        b.z[:], b.P[:] = ukf.x, 0.5 * (ukf.P + ukf.P.T)

    def _use(self, b: Belief, value: float, variance: float, row: int | None) -> float:
        ukf = self._ukf
        ukf.x, ukf.P = b.z.copy(), b.P.copy()
        # filterpy keeps the points of the prediction, which lack its noise: they are drawn again
        ukf.sigmas_f = ukf.points_fn.sigma_points(ukf.x, ukf.P)
        shown = (lambda z: self._position(z, b)) if row is None else (lambda z: z[row : row + 1])
        ukf.update(np.array([value]), R=variance, hx=shown)
        spread = math.sqrt(max(float(ukf.S[0, 0]), 0.0))
        size = float(ukf.y[0]) / spread if spread > 0 else math.inf
        if abs(size) <= self.noise.gate:
            b.z[:], b.P[:] = ukf.x, 0.5 * (ukf.P + ukf.P.T)
        return size if size == size else math.inf

    def _moved_state(self, z: Array) -> Array:
        (modes, before, command, t), k = self._from, self.model.kernels
        states = modes[None, :].copy()
        states[0, self.where] = z[:-2]
        k.run(states, before, command, z[-2:-1].copy(), t, k.tick_s, k.substeps, self.level.numbers(z[-1]))
        return np.asarray(states[0])

    def _moved(self, z: Array, dt: float) -> Array:
        return np.append(self._moved_state(z)[self.where], z[-2:])

    def _position(self, z: Array, b: Belief) -> Array:
        """The position that the sensor shows at the point `z` of the estimate `b`, shape (1,)."""
        if self.model.placed:
            return z[:1]
        state = b.modes.copy()
        state[self.where] = z[:-2]
        return np.array([float(self._seen(state, b.time_s)[0])])


class UnscentedEstimator(CubatureEstimator):
    """filterpy's arithmetic, at ten times the cost of a compiled filter."""

    process: ClassVar[type[Process]] = FilterpyProcess
