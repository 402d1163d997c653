"""The slow loop on the averaged motion: a Kalman filter for the bias of the mean speed, and an MPC for its command.

Averaged over the cycles, with progress p, the speed s of the map, its lag tau, and the map's error b:

    p' = s + b,    s' = (u - s)/tau,    b' = white noise.
"""

import math
from dataclasses import dataclass

import numpy as np

from controller.signals import Array

_LONGEST_STEP_S = 1.0  # longest prediction of the filter
_ENOUGH = 1e-6  # m/s, change of the commands below which a plan is done
_GATE = 6.0  # standard deviations beyond which a reading is an outlier


@dataclass(frozen=True)
class Tuning:
    """`tick_s` of the loop; readings are used `sample_s` apart. Missed progress is recovered at up to `catch_up` of the
    speed, faster or slower, `catch_up_stopped` if a stop cost more than `near_m`. `blind_s` after the last good
    estimate the drive rests. `feedback` False leaves the feedforward alone.
    """

    tick_s: float = 1e-3
    sample_s: float = 9.5e-3
    catch_up: float = 0.03
    catch_up_stopped: float = 0.12
    catch_up_s: float = 0.7
    near_m: float = 0.4e-3
    blind_s: float = 1.0
    feedback: bool = True


@dataclass
class ProgressFilter:
    """Kalman filter on (p in m, s in m/s, b in m/s) with late, noisy positions. `wander` in m/s per root second and
    `wander_share` of the commanded speed are the random walk of b, `slope_doubt` its share of a change of command;
    `ripple_m` is the motion of the body within a cycle.
    """

    lag_s: float
    reading_std_m: float = 0.5e-3
    ripple_m: float = 0.5e-3
    wander: float = 0.06e-3
    wander_share: float = 0.012
    slope_doubt: float = 0.5
    doubt: float = 1.5e-3
    doubt_share: float = 0.3

    def __post_init__(self) -> None:
        self.start(0.0, 0.0)

    def start(self, time_s: float, position_m: float) -> None:
        """At rest at `position_m`, b unknown."""
        self.time_s, self.missed, self.learned_at = time_s, 0, 0.0
        self.z = np.array([position_m, 0.0, 0.0])
        self.P = np.diag([self.reading_std_m**2, 0.0, self.doubt**2])

    def doubt_bias(self, bias_m_s: float, speed_m_s: float) -> None:
        """Restart with b = `bias_m_s`, uncertain by a share of `speed_m_s`."""
        self.z[2], self.learned_at = bias_m_s, speed_m_s
        self.P[2, :] = self.P[:, 2] = 0.0
        self.P[2, 2] = (self.doubt + self.doubt_share * abs(speed_m_s)) ** 2

    def predict(self, time_s: float, command_m_s: float) -> None:
        h = min(max(time_s - self.time_s, 0.0), _LONGEST_STEP_S)
        self.time_s = max(time_s, self.time_s)
        if h == 0:
            return
        apart = abs(command_m_s - self.learned_at)
        if apart > 0.3e-3 + 0.1 * abs(self.learned_at):
            self.P[2, 2] += (self.slope_doubt * apart) ** 2
            self.learned_at = command_m_s
        F, shift = transition(h, self.lag_s)
        self.z = F @ self.z + shift * command_m_s
        q = (self.wander + self.wander_share * abs(command_m_s)) ** 2
        noise = q * np.array([[h**3 / 3, 0.0, h * h / 2], [0.0, 0.0, 0.0], [h * h / 2, 0.0, h]])
        self.P = F @ self.P @ F.T + noise

    def correct(self, position_m: float) -> None:
        """Use a reading unless it is farther off than noise can be; after ten such in a row it is accepted."""
        S = self.P[0, 0] + self.reading_std_m**2 + self.ripple_m**2
        error = position_m - self.z[0]
        if error * error > _GATE**2 * S and self.missed < 10:
            self.missed += 1
            return
        if self.missed >= 10:
            self.P[0, 0] += error * error
            S += error * error
        self.missed = 0
        gain = self.P[:, 0] / S
        self.z = self.z + gain * error
        rest = np.eye(3)
        rest[:, 0] -= gain
        self.P = rest @ self.P @ rest.T + np.outer(gain, gain) * (self.reading_std_m**2 + self.ripple_m**2)


def transition(h: float, lag_s: float) -> tuple[Array, Array]:
    """The averaged motion over `h` in s, exact: `z+ = F z + g u` for z = (p, s, b) and u held."""
    keep = math.exp(-h / lag_s)
    glide = lag_s * (1 - keep)
    return np.array([[1.0, glide, h], [0.0, keep, 0.0], [0.0, 0.0, 1.0]]), np.array([h - glide, 1 - keep, 0.0])


_PROGRESS_M, _SPEED_M_S, _CHANGE_M_S = 1.0e-3, 2.0e-3, 4.0e-3
"""Size of 1 in a plan's cost: error of progress in m, of mean speed in m/s, change of the command per step in m/s."""


class AveragedMpc:
    """Over `horizon` steps of `step_s`: least squares of progress, speed and change of command, with a bounded command.
    Condensed once; a step is one matrix product and, if bounds are active, a limited number of sweeps over the
    commands.
    """

    def __init__(self, lag_s: float, step_s: float = 0.1, horizon: int = 12) -> None:
        self.step_s, self.horizon = step_s, horizon
        F, g = transition(step_s, lag_s)
        self.free = np.zeros((2 * horizon, 3))
        self.forced = np.zeros((2 * horizon, horizon))
        power, columns = np.eye(3), [g]
        for k in range(horizon):
            power = F @ power
            for j in range(k + 1):
                response = columns[k - j]
                self.forced[k, j] = response[0] / _PROGRESS_M
                self.forced[horizon + k, j] = (response[1] + response[2]) / _SPEED_M_S
            self.free[k] = power[0] / _PROGRESS_M
            self.free[horizon + k] = (power[1] + power[2]) / _SPEED_M_S
            columns.append(F @ columns[-1])
        self.scale = np.concatenate((np.full(horizon, 1 / _PROGRESS_M), np.full(horizon, 1 / _SPEED_M_S)))
        change = (np.eye(horizon) - np.eye(horizon, k=-1)) / _CHANGE_M_S
        self.last = 1 / _CHANGE_M_S**2
        self.hessian = self.forced.T @ self.forced + change.T @ change
        self.inverse = np.linalg.inv(self.hessian)
        self._diagonal = np.diag(self.hessian).tolist()

    def plan(
        self,
        z: Array,
        last_m_s: float,
        positions_m: Array,
        speeds_m_s: Array,
        low_m_s: float,
        high_m_s: float,
        sweeps: int = 20,
    ) -> Array:
        """Commands (horizon,) in m/s from `z` = (p, s, b) for the wanted values at the ends of the steps."""
        wanted = np.concatenate((positions_m, speeds_m_s)) * self.scale - self.free @ z
        gradient = self.forced.T @ wanted
        gradient[0] += self.last * last_m_s
        u = self.inverse @ gradient
        if u.min() >= low_m_s and u.max() <= high_m_s:
            return np.asarray(u)
        u = np.clip(u, low_m_s, high_m_s)
        slope = gradient - self.hessian @ u
        for _ in range(sweeps):
            largest = 0.0
            for j in range(self.horizon):
                to = min(max(float(u[j]) + float(slope[j]) / self._diagonal[j], low_m_s), high_m_s)
                step = to - float(u[j])
                if step != 0.0:
                    u[j] = to
                    slope -= self.hessian[j] * step
                    largest = max(largest, abs(step))
            if largest < _ENOUGH:
                break
        return np.asarray(u)
