"""filterpy's unscented filter on the same process: selectable, and the reference of the fast filters' tests."""

import math
from typing import Any, ClassVar

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from controller.estimator.gaussian import Belief, GaussianEstimator, Process
from controller.estimator.kernels import root
from controller.model.control_model import ControlModel
from controller.signals import Array
from controller.tuned import FilterNoise
from models.parameter import Name


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

    def predict(self, b: Belief, command: float) -> None:
        ukf = self._ukf
        ukf.x, ukf.P, ukf.Q = b.z.copy(), b.P.copy(), np.diag(self._noise_of(b))
        self._from = (b.modes.copy(), self.model.command_from(b.command, command), command, b.time_s)
        b.modes[:] = self._moved_state(b.z)
        ukf.predict()
        b.z[:], b.P[:] = ukf.x, 0.5 * (ukf.P + ukf.P.T)
        b.time_s += self.model.tick_s
        b.command = command

    def see(self, b: Belief, value: float, state: Name | None = None) -> float:
        ukf, row = self._ukf, 0 if state is None else self.names.index(state)
        std = self.noise.position_std_m if state is None else self.noise.feedback_std
        ukf.x, ukf.P = b.z.copy(), b.P.copy()
        # filterpy keeps the points of the prediction, which lack its noise: they are drawn again
        ukf.sigmas_f = ukf.points_fn.sigma_points(ukf.x, ukf.P)
        shown = (lambda z: self._position(z, b)) if state is None else (lambda z: z[row : row + 1])
        ukf.update(np.array([value]), R=std**2, hx=shown)
        spread = math.sqrt(max(float(ukf.S[0, 0]), 0.0))
        size = float(ukf.y[0]) / spread if spread > 0 else math.inf
        if abs(size) <= self.noise.gate:
            b.z[:], b.P[:] = ukf.x, 0.5 * (ukf.P + ukf.P.T)
            b.surprise = self.noise.surprised(b.surprise, size) if state is None else b.surprise
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
        if self._plain:
            return z[:1]
        state = b.modes.copy()
        state[self.where] = z[:-2]
        return np.array([float(self._seen(state, b.time_s)[0])])


class UnscentedEstimator(GaussianEstimator):
    """filterpy's arithmetic, at ten times the cost of a compiled filter."""

    process: ClassVar[type[Process]] = FilterpyProcess
