"""A viscous wall that thins: Carreau's law, its limits, and what it leaves of a power law."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from models.assembly.effects import Active
from models.effects.effect import Signals
from models.effects.refinements import ViscosityThinning
from models.effects.wall import WallViscosity
from models.theta import Theta

Array = NDArray[np.float64]
RATES = np.linspace(-0.02, 0.02, 201)
NAMES = [(e.id, p.name) for e in (WallViscosity, ViscosityThinning) for p in e.parameters()]


def force(viscosity: float, power: float, rate: float, at: Array = RATES) -> Array:
    p = dict(zip(NAMES, (viscosity, power, rate), strict=True))
    return np.asarray(
        Active((WallViscosity, ViscosityThinning), Theta.of(p)).total("wall_force", Signals(drag_rate=at))
    )


def test_with_no_power_it_is_the_viscous_wall_alone() -> None:
    np.testing.assert_allclose(force(2.0, 0.0, 2e-3), 2.0 * RATES)


def test_slow_it_is_viscous_and_fast_a_power_law() -> None:
    slow, fast = np.array([1e-6]), np.array([1.0, 2.0])
    assert force(2.0, -0.4, 2e-3, slow) == pytest.approx(2e-6, rel=1e-6)
    twice = force(2.0, -0.4, 2e-3, fast)
    assert twice[1] / twice[0] == pytest.approx(2**0.6, rel=1e-3)


def test_with_it_a_power_law_is_met_to_a_fifth_of_what_a_viscous_wall_leaves() -> None:
    law = 0.02 * np.sign(RATES) * (np.abs(RATES) / 0.01) ** 0.7

    def left(start: tuple[float, ...]) -> float:
        def off(x: Array) -> Array:
            return 1e3 * (force(*([*x, 0.0, 2e-3][:3])) - law)

        bounds = ([0, -0.9, 1e-4][: len(start)], [30, 0.5, 2e-2][: len(start)])
        return float(np.abs(least_squares(off, start, x_scale=(1.0, 0.1, 1e-3)[: len(start)], bounds=bounds).fun).max())

    assert left((2.0, -0.1, 2e-3)) < 0.2 * left((2.0,))
