"""The finer shape of a drift: nothing at the start, and what it leaves of a drift that settles exponentially."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from models.assembly.effects import Active
from models.effects.effect import Signals
from models.effects.friction import TissueDrying
from models.effects.refinements import DryingShape
from models.theta import Theta

Array = NDArray[np.float64]
TIME = np.linspace(0.0, 45.0, 200)
EXCESS, SETTLES_S = 0.5, 20.0
NAMES = [(e.id, p.name) for e in (TissueDrying, DryingShape) for p in e.parameters()]


def level(values: Array) -> Array:
    """Of both effects, at the first few of `NAMES`, the others absent."""
    p = dict.fromkeys(NAMES, 0.0) | dict(zip(NAMES, map(float, values), strict=False))
    return np.asarray(Active((TissueDrying, DryingShape), Theta.of(p)).product("level", Signals(t=TIME)))


def left(count: int, power: float = 1.0) -> float:
    """Largest difference from `1 + a (1 - exp(-(t/T)^power))` of the best level with the first `count` parameters."""
    drying = 1 + EXCESS * (1 - np.exp(-((TIME / SETTLES_S) ** power)))
    start = np.array([0.02, 0.0, 30.0, 0.0, 0.0, 0.0])[:count]
    scale = np.array([1e-3, 1e-4, 10.0, 0.01, 0.01, 0.01])[:count]
    fit = least_squares(
        lambda x: level(x) - drying, start, x_scale=scale, bounds=([-1, -1, 5, -1, -1, -1][:count], np.inf)
    )
    return float(np.abs(fit.fun).max())


def test_it_begins_with_nothing() -> None:
    assert level(np.array([0.02, 0.001, 30.0, 0.5, -0.5, 0.5]))[0] == 1.0


def test_with_it_an_exponential_drift_is_met_to_a_tenth_of_what_the_drift_alone_leaves() -> None:
    assert left(6) < 0.1 * left(3)


def test_with_it_a_drift_that_begins_slowly_and_does_not_settle_as_the_drying_alone_would_is_met_as_well() -> None:
    assert left(6, 1.7) < 0.1 * left(3, 1.7)
