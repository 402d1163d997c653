"""Descents on jagged criteria: least squares' own answers where they are smooth, long valleys, bounds, and never
uphill.
"""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from models.identification.fitting.gauss_newton import GaussNewton

Array = NDArray[np.float64]


def valley(
    function: Callable[[Array], Array], lower: list[float], upper: list[float], scale: list[float]
) -> GaussNewton:
    return GaussNewton(stacked(function), np.array(lower), np.array(upper), np.array(scale))


def stacked(function: Callable[[Array], Array]) -> Callable[[Sequence[Array]], Array]:
    """Residuals of many points at once, a row each."""
    return lambda points: np.array([function(x) for x in points])


@given(st.integers(0, 1000), st.floats(0.3, 3.0))
def test_linear_least_squares_within_bounds(seed: int, half: float) -> None:
    rng = np.random.default_rng(seed)
    A, b = rng.standard_normal((30, 3)), 5 * rng.standard_normal(30)
    found = valley(lambda x: A @ x - b, [-half] * 3, [half] * 3, [0.1] * 3).minimum(np.zeros(3), [0.1], 30)
    assert found.cost == pytest.approx(2 * lsq_linear(A, b, (-half, half)).cost, rel=1e-3)


@given(st.lists(st.floats(-1, 1), min_size=3, max_size=3), st.sampled_from([1.0, 0.1]), st.floats(0, 3))
def test_never_ends_higher_than_it_began(start: list[float], secant: float, jag: float) -> None:
    def rough(x: Array) -> Array:
        smooth = np.array([x[0] + x[1], x[1] ** 2 - x[2], np.sin(3 * x[2]), x[0] - 0.3])
        return np.asarray(smooth + jag * np.sign(np.sin(40 * x[0] + 17 * x[1])))

    x = np.array(start)
    inside = np.clip(x, -1 + 2e-9, 1 - 2e-9)
    found = valley(rough, [-1.0] * 3, [1.0] * 3, [0.1] * 3).minimum(inside, [secant], 6)
    assert found.cost <= float(rough(inside) @ rough(inside))
    assert np.all(np.abs(found.x) <= 1)


def test_powers_of_time_under_quantisation() -> None:
    """Three powers nearly make up for one another, and rounding hides what any one of them does in a short secant."""
    t = np.linspace(0, 45, 4000)
    true = np.array([1.2e-2, -1.7e-4, 1.0e-6])

    def seen(x: Array) -> Array:
        return np.asarray(np.round((x[0] + (x[1] + x[2] * t) * t) * t / 0.02))

    data = seen(true)
    ground = valley(lambda x: seen(x) - data, [-0.02, -3e-4, -5e-6], [0.03, 3e-4, 5e-6], [1e-3, 1e-6, 2e-8])
    x = ground.minimum(np.array([6e-3, 0.0, 0.0]), (0.3, 0.1), 24).x
    assert x == pytest.approx(true, rel=0.05)


def test_a_parameter_that_starts_at_its_bound_leaves_it() -> None:
    t = np.linspace(0, 1, 200)
    data = 2.0 * t + 0.5
    found = valley(lambda x: 100 * (x[0] * t + x[1] - data), [0.0, 0.0], [5.0, 5.0], [0.1, 0.1]).minimum(
        np.array([1e-8, 1e-8]), [0.3], 12
    )
    assert found.x == pytest.approx([2.0, 0.5], rel=1e-4)


def test_a_parameter_without_effect_stays() -> None:
    t = np.linspace(0, 1, 50)
    found = valley(lambda x: x[0] * t - t, [-9.0, -9.0], [9.0, 9.0], [0.1, 0.1]).minimum(
        np.array([0.0, 3.0]), [0.1], 12
    )
    assert found.x[0] == pytest.approx(1.0, abs=1e-6)
    assert np.isfinite(found.jacobian).all()
    assert not found.jacobian[:, 1].any()


def test_widths_give_way_where_a_width_no_longer_gains() -> None:
    """Under a ripple narrow secants are caught at once and wide ones stop above the end: in turn they come lowest."""
    costs = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        A, phase = rng.standard_normal((40, 3)), rng.uniform(0, 2 * np.pi, 40)

        def ripple(x: Array, A: Array = A, phase: Array = phase) -> Array:
            return np.asarray(10 * A @ x + 2 * np.sin(30 * A @ x + phase))

        ground = valley(ripple, [-5.0] * 3, [5.0] * 3, [0.1] * 3)
        ends = [ground.minimum(np.array([1.0, -2.0, 1.5]), widths, 60) for widths in ([1.0, 0.03], [1.0], [0.03])]
        costs.append([end.cost for end in ends])
    in_turn, wide, narrow = np.mean(costs, axis=0)
    assert in_turn < wide < 0.1 * narrow


def test_a_width_that_never_gains_costs_one_round() -> None:
    """At the bottom already: a round a width, and one that settles the last."""
    rounds = 0

    def counted(points: Sequence[Array]) -> Array:
        nonlocal rounds
        rounds += len(points) == 4  # both sides along two directions
        return np.array([[x[0], x[1], 1.0] for x in points])

    ends = np.ones(2)
    found = GaussNewton(counted, -ends, ends, 0.1 * ends).minimum(np.zeros(2), (0.3, 0.1, 0.03), 40)
    assert rounds == 3
    assert found.x == pytest.approx([0.0, 0.0], abs=1e-9)


def test_the_products_are_those_of_the_derivatives() -> None:
    rng = np.random.default_rng(4)
    A, b = rng.standard_normal((700, 4)), rng.standard_normal(700)
    found = valley(lambda x: A @ x - b, [-9.0] * 4, [9.0] * 4, [0.1] * 4).minimum(np.zeros(4), [0.1], 1)
    assert found.jacobian == pytest.approx(A, abs=1e-9)
    assert found.normal == pytest.approx(A.T @ A)
    assert found.gradient == pytest.approx(-A.T @ b)
    assert found.turned @ np.linalg.inv(found.turned) == pytest.approx(np.eye(4), abs=1e-9)
