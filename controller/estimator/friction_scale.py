"""The friction level that estimators learn: which parameter of the model it moves, how far, and what that means as a
force.
"""

import numpy as np
from numpy.typing import NDArray

from controller.model.control_model import ControlModel
from controller.signals import Adapted

Array = NDArray[np.float64]


class Level:
    """A level of l makes the parameter at `index` (1 + l) times `middle`, the model's own; l within [`low`, `high`],
    the parameter's bounds.
    """

    def __init__(self, model: ControlModel) -> None:
        self._values, self._kernels = model.values, model.kernels
        self.index = 0  # of a surface's parameters, which stand first, the one that scales its friction
        parameter = model.symbols.parameters[self.index]
        self.middle = float(model.values[self.index])
        self.low, self.high = (bound / self.middle - 1 for bound in (parameter.lower, parameter.upper))
        self._path, self._held, self._slopes = (
            np.zeros(s) for s in ((1, len(model.states)), (1,), (1, len(model.states)))
        )

    def numbers(self, level: float) -> Array:
        """The model's parameters (p,) at `level`."""
        numbers = self._values.copy()
        numbers[self.index] *= 1 + min(max(level, self.low), self.high)
        return numbers

    def adapted(self, state: Array, t: float, level: float, force_N: float) -> tuple[float, Adapted]:
        """The force in N along +x that the model's own parameters lack in the motion of `state` (n,) at `t`, and the
        same with those of `level`, which lack `force_N`.
        """
        numbers = self.numbers(level)
        self._path[0] = state
        return force_N + self._wall(t, self._values) - self._wall(t, numbers), Adapted(numbers, force_N)

    def _wall(self, t: float, numbers: Array) -> float:
        self._kernels.holds(self._path, self._held, self._slopes, t, self._kernels.tick_s, numbers)
        return float(self._held[0])
