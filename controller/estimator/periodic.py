"""Where a periodic effect of the gut is, and how large: each particle has its own phase and size."""

import cmath
import math
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from controller.estimator.kernels import expected
from controller.model.control_model import ControlModel
from controller.signals import Array
from models.effects.effect import Effect

_REDRAWN_1_S: Final = (0.3, 1.0)
"""Rate at which a particle redraws them once the effect has been doubted, and while innovations have one sign."""
_ABSENT: Final = 0.2  # share of the redrawn ones without the effect
_WALK_RAD: Final = 0.3  # walk of the phase per root second, of those redrawn
_LEVEL_STD: Final = 0.05  # of the friction level of those redrawn, about its mean
_MEAN_S: Final = 3.0  # over which that mean is taken


class Periodic:
    """The phase and size of a periodic effect, as folds, of each particle: `values` (2, P), the parameters at `index`.

    All begin with the model's. Once the innovations have one sign, some particles redraw theirs: the effect may be
    elsewhere, or absent. The readings decide. The estimate is the weighted mean of `size exp(i phase)`: uncertain
    particles make the effect smaller. Without such an effect there are no parameters, and nothing is drawn.
    """

    def __init__(self, model: ControlModel, effect: type[Effect] | None, count: int) -> None:
        keys = [p.key for p in model.symbols.parameters]
        names = () if effect is None else (effect.amplitude().name, effect.of_role("phase"))
        self.index = np.array([keys.index((effect.id, str(name))) for name in names if effect], dtype=np.int64)
        self._own = model.values[self.index]
        self.values = np.zeros((len(names), count))
        self._moved = np.zeros(count, dtype=bool)
        self.begin()

    @classmethod
    def of(cls, model: ControlModel, count: int) -> Self:
        """That of the first periodic effect in `model`, if it has one."""
        periodic = (
            effect
            for effect in model.symbols.effects
            if effect.of_role("phase") and any(p.name == "wavelength_m" for p in effect.parameters())
        )
        return cls(model, next(periodic, None), count)

    def begin(self) -> None:
        self.values[:] = self._own[:, None]
        self._moved[:], self._level = False, 0.0

    def scatter(
        self, draws: np.random.Generator, passed_s: float, surprised: bool, levels: Array, weights: Array
    ) -> None:
        """After `passed_s`: walk, and redraw some of the particles with these `levels` and `weights`."""
        if not self.index.size:
            return
        self._level += passed_s / _MEAN_S * (expected(weights, levels)[0] - self._level)
        moved = self._moved
        self.values[1, moved] += _WALK_RAD * math.sqrt(passed_s) * draws.standard_normal(int(moved.sum()))
        if not (surprised or moved.any()):
            return
        new = np.flatnonzero(draws.random(moved.size) < _REDRAWN_1_S[surprised] * passed_s)
        moved[new] = True
        self.values[0, new] = np.where(draws.random(new.size) < _ABSENT, 0.0, self._own[0])
        self.values[1, new] = draws.uniform(-math.pi, math.pi, new.size)
        levels[new] = self._level + _LEVEL_STD * draws.standard_normal(new.size)

    def take(self, chosen: NDArray[np.int64]) -> None:
        self.values[:], self._moved[:] = self.values[:, chosen], self._moved[chosen]

    def mean(self, weights: Array) -> Array:
        """Size and phase (2,) of all particles by their `weights`."""
        if not self._moved.any():
            return self._own
        whole = complex(np.sum(weights * self.values[0] * np.exp(1j * self.values[1])))
        sign = math.copysign(1.0, self._own[0])
        return np.array([abs(whole) * sign, cmath.phase(whole * sign)])
