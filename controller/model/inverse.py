"""The control model turned round: which command, held for a few ticks, gives the capsule a wanted speed."""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from controller.limits import Envelope
from controller.model.control_model import ControlModel
from controller.signals import Array

_EVALUATIONS: Final = 30  # of the model at most, to find a command
_SHARE: Final = 1e-4  # of the commands that come into question, to which one is found
_JUMP_S: Final = 1e-7  # step in which the command in force goes over to one that is tried
_JUMP_STEPS: Final = 4  # in which it is integrated


class Inverse:
    """`command(x, d, v)` such that the model goes from the state `x` under the disturbance `d` to the speed `v` within
    `reach_s`.

    The model's own step is inverted with whatever it holds: stick, slip, inertia, the stable branch of a magnet, a
    coil's circuit, what effects put between command and force. What remembers where a carriage came from, as play does,
    is first taken along at once from the command in force. The speed grows with the command, so a bracket closes on it
    (regula falsi, Illinois), by at most `_EVALUATIONS` steps of the model.
    """

    def __init__(self, model: ControlModel, envelope: Envelope, reach_s: float = 4e-3) -> None:
        self.model = replace(model.sharp, tick_s=reach_s)
        self._kernels, self._envelope = self.model.kernels, envelope
        self._parameters = self._kernels.parameters
        self._state = np.zeros((1, len(model.states)))
        self._d = np.zeros(1)
        self._remembers = envelope.placed and not all(isinstance(name, str) for name in model.states)
        self._before = math.nan

    def command(
        self,
        x: Array,
        disturbance_N: float,
        speed_m_s: float,
        t: float,
        parameters: Array | None = None,
        before: float = math.nan,
    ) -> float:
        """The command in the drive's unit, at the end of its range where none is enough; NaN where something is no
        number. `parameters` (p,) stand in for the model's own; `before` is the command in force (NaN: as tried, for
        long).
        """
        self._before = before if self._remembers else math.nan
        self._parameters = self._kernels.parameters if parameters is None else parameters
        e, place = self._envelope, float(x[0])
        low, high = (max(e.low, place - e.gap_m), min(e.high, place + e.gap_m)) if e.placed else (e.low, e.high)
        if not (math.isfinite(low + high + disturbance_N + speed_m_s) and np.isfinite(x).all()):
            return math.nan
        below, above = (self._reached(x, c, disturbance_N, t) - speed_m_s for c in (low, high))
        if below * above >= 0:
            return low if (abs(below) < abs(above)) else high
        last, near = 0, _SHARE * (high - low)
        for _ in range(_EVALUATIONS):
            if high - low <= near or math.isnan(below + above):
                break
            middle = (low * above - high * below) / (above - below)
            middle = min(max(middle, low + 0.02 * (high - low)), high - 0.02 * (high - low))
            error = self._reached(x, middle, disturbance_N, t) - speed_m_s
            if error * above > 0:
                high, above = middle, error
                below, last = (0.5 * below if last == 1 else below), 1
            else:
                low, below = middle, error
                above, last = (0.5 * above if last == -1 else above), -1
        return 0.5 * (low + high)

    def _reached(self, x: Array, command: float, d: float, t: float) -> float:
        """Speed in m/s after `reach_s` under `command`."""
        self._state[0], self._d[0] = x, d
        k = self._kernels
        if not math.isnan(self._before):
            k.run(self._state, self._before, command, self._d, t, _JUMP_S, _JUMP_STEPS, self._parameters)
        k.run(self._state, command, command, self._d, t, k.tick_s, k.substeps, self._parameters)
        return float(self._state[0, 1])
