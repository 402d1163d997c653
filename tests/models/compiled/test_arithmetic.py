"""The arithmetic that compiled models are written in: against NumPy's, and several parameter sets side by side against
one.
"""

import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from models.compiled.kernel import LANES, Kernel

Array = NDArray[np.float64]
UNIT = 2.3e-16


def evaluated(function: Callable[[Any], Any], x: Array) -> Array:
    """`function` of each of `x` by a compiled loop that holds nothing else."""
    state, c0, c1, t, h, p = (ca.SX.sym(name) for name in ("s", "c0", "c1", "t", "h", "p"))
    step = ca.Function("step", [state, c0, c1, t, h, p], [state, function(p)])
    kernel, once = Kernel(step, ca.Function("stay", [state, t, h], [state])), np.zeros(1)
    rows = np.append(x, np.full(-len(x) % LANES, 1.0)).reshape(-1, 1, LANES)
    output = np.empty((len(rows), 1, LANES))
    for parameters, shown in zip(rows, output, strict=True):
        kernel.many(np.zeros((1, LANES)), once, shown, 0.0, parameters, 1, 1.0, shown, 0.0)
    return output.ravel()[: len(x)]


RANGES = {
    "exp": (ca.exp, np.exp, np.linspace(-700, 700, 5001)),
    "log": (ca.log, np.log, np.geomspace(1e-300, 1e300, 5001)),
    "log1p": (ca.log1p, np.log1p, np.concatenate([np.geomspace(1e-20, 1e6, 2501), -np.geomspace(1e-20, 0.99, 2501)])),
    "sin": (ca.sin, np.sin, np.linspace(-3, 3, 5001)),
    "cos": (ca.cos, np.cos, np.linspace(-1.5, 1.5, 5001)),
    "sqrt": (ca.sqrt, np.sqrt, np.geomspace(1e-300, 1e300, 501)),
}
BOTH_SIDES = np.concatenate([np.linspace(-30, 30, 6001), np.geomspace(1e-20, 1.1, 501), [-700.0, 700.0]])
HYPERBOLIC = {
    "sinh": (ca.sinh, np.sinh),
    "cosh": (ca.cosh, np.cosh),
    "tanh": (ca.tanh, np.tanh),
    "expm1": (ca.expm1, np.expm1),
}


@pytest.mark.parametrize("name", RANGES)
def test_elementary_functions_are_numpys_to_the_last_places(name: str) -> None:
    symbolic, numeric, x = RANGES[name]
    np.testing.assert_allclose(evaluated(symbolic, x), numeric(x), rtol=3 * UNIT, atol=UNIT * 1e-3)


@pytest.mark.parametrize("name", HYPERBOLIC)
def test_hyperbolic_functions_are_numpys_to_a_few_last_places(name: str) -> None:
    symbolic, numeric = HYPERBOLIC[name]
    np.testing.assert_allclose(evaluated(symbolic, BOTH_SIDES), numeric(BOTH_SIDES), rtol=5 * UNIT)


def test_sine_and_cosine_keep_their_accuracy_over_many_turns() -> None:
    x = np.linspace(-5e5, 5e5, 5001)
    np.testing.assert_allclose(evaluated(ca.sin, x), np.sin(x), atol=2 * UNIT)
    np.testing.assert_allclose(evaluated(ca.cos, x), np.cos(x), atol=2 * UNIT)


@given(st.lists(st.floats(1e-12, 1e6), min_size=1, max_size=20))
def test_a_power_is_within_a_few_last_places(x: list[float]) -> None:
    np.testing.assert_allclose(evaluated(_power, np.array(x)), np.array(x) ** 0.2448, rtol=1e-14)


def _power(c: Any) -> Any:
    return c**0.2448


def test_ends_of_the_ranges() -> None:
    with np.errstate(all="ignore"):
        assert evaluated(ca.log, np.array([0.0, -1.0, math.inf])).tolist()[::2] == [-math.inf, math.inf]
        assert math.isnan(evaluated(ca.log, np.array([-1.0]))[0])
        assert evaluated(lambda c: c**0.5, np.array([0.0]))[0] == 0.0
        assert evaluated(lambda c: c**-2.5, np.array([0.0]))[0] == math.inf
        assert evaluated(lambda c: c**3, np.array([-2.0]))[0] == -8.0
        assert math.isnan(evaluated(ca.exp, np.array([math.nan]))[0])


def test_choices_are_casadis() -> None:
    x = np.array([-2.0, -0.5, 0.0, 0.5, 2.0])

    def mixed(c: Any) -> Any:
        inside = ca.logic_and(c > -1, ca.logic_not(c > 1))
        return ca.if_else(inside, ca.fmin(c, 0.25), ca.fmax(-c, -1)) + ca.sign(c) + ca.fabs(c) * (c != 0)

    symbol = ca.SX.sym("c")
    expected = ca.Function("f", [symbol], [mixed(symbol)]).map(len(x))(x[None, :])
    np.testing.assert_array_equal(evaluated(mixed, x), np.array(expected).ravel())


def test_lanes_give_the_numbers_of_a_single_run_to_the_last_bit() -> None:
    state, c0, c1, t, h, p = (ca.SX.sym(n) for n in ("s", "c0", "c1", "t", "h", "p"))
    new = state + h * (c1 - ca.sin(p * state) - state**3 + ca.log1p(ca.fabs(state)))
    kernel = Kernel(
        ca.Function("step", [state, c0, c1, t, h, p], [new, new]), ca.Function("f", [state, t, h], [state + h * t])
    )
    command, seen = np.sin(np.linspace(0, 9, 300)), np.cos(np.linspace(0, 9, 300))
    parameters, for_each = np.linspace(0.5, 4.0, LANES), np.repeat(seen[:, None], LANES, axis=1)
    for gain in (0.0, 0.2):
        side_by_side = np.empty((300, LANES))
        kernel.many(
            np.zeros((1, LANES)), command, for_each, gain, parameters[None, :].copy(), 4, 0.01, side_by_side, 0.0
        )
        for k, value in enumerate(parameters):
            alone = np.empty(300)
            kernel.one(np.zeros(1), command, seen, gain, np.array([value]), 4, 0.01, alone)
            assert np.array_equal(alone, side_by_side[:, k])
