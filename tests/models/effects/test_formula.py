"""Formulas written down from functions: their text has the functions' values, and reads as a person would write it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.effects.equation import text_of
from models.effects.friction import LumenTaper
from models.formula import Formula, at_least, equal, interpolated, named, polynomial, value_of, written
from tests.models.effects import read_formula

LEAVES = st.sampled_from(["a", "b", "c"]) | st.floats(-9, 9).map(lambda x: round(x, 3))
TREES = st.recursive(
    LEAVES,
    lambda inner: st.tuples(st.sampled_from("+-*/^m"), inner, inner) | st.tuples(st.sampled_from("nesw"), inner),
    max_leaves=12,
)
NAMES = {"a": 0.7, "b": -1.3, "c": 2.1}


def computed(tree: Any, names: dict[str, Any]) -> Any:
    """A tree of operations on numbers or formulas."""
    if isinstance(tree, str):
        return names[tree]
    if isinstance(tree, float):
        return tree
    name, *inputs = tree
    x, *rest = (computed(one, names) for one in inputs)
    y = rest[0] if rest else None
    operations: dict[str, Callable[[], Any]] = {
        "+": lambda: x + y,
        "-": lambda: x - y,
        "*": lambda: x * y,
        "/": lambda: x / (1.5 + np.sin(y)),
        "^": lambda: (2 + np.sin(x)) ** np.clip(y, -2.0, 2.0),
        "m": lambda: np.maximum(x, y),
        "n": lambda: -x,
        "e": lambda: np.exp(np.sin(x)),
        "s": lambda: np.sign(x) * np.sqrt(np.abs(x)),
        "w": lambda: np.where(x > 0.5, x * x, 1 - x),
    }
    return operations[name]()


@given(TREES)
def test_the_text_has_the_value_of_what_it_was_written_from(tree: Any) -> None:
    with np.errstate(all="ignore"):
        wanted = float(computed(tree, NAMES))
        formula = Formula.of(computed(tree, {name: Formula(name) for name in NAMES}))
        got = float(value_of(formula, NAMES)), float(read_formula.value_of(written(formula, 17), NAMES))
    if np.isfinite(wanted):
        assert got == pytest.approx((wanted, wanted), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("law", "text"),
    [
        (lambda a, b: 1 + 0 * b + a * 1, "1 + a"),
        (lambda a, b: a - (b - a), "a - (b - a)"),
        (lambda a, b: a / (b / a), "a^2/b"),
        (lambda a, b: a / b * (a + 1) / 2, "a (a + 1)/(2 b)"),
        (lambda a, b: -(a * b) + 2 * a, "-a b + 2 a"),
        (lambda a, b: a * -3.0 - -b, "-3 a + b"),
        (lambda a, b: (a + b) ** 2, "(a + b)^2"),
        (lambda a, b: np.exp(-a) * np.abs(b), "exp(-a) |b|"),
        (lambda a, b: 2 * np.pi * (a * b), "2 pi a b"),
        (lambda a, b: (lambda q: q / np.sqrt(1 + q * q))(a - 2 * b), "q_1/sqrt(1 + q_1^2), q_1 = a - 2 b"),
        (lambda a, b: (lambda r: r / (1 + r))(named("r", a / b)), "r/(1 + r), r = a/b"),
        (lambda a, b: equal(b, at_least(a, 1e-9)), "b = a"),
        (lambda a, b: polynomial(a, 1, b, 3.0), "1 + b a + 3 a^2"),
        (lambda a, b: interpolated(a, [0, 1], [b, 2]), "interp(a, [0, 1], [b, 2])"),
    ],
)
def test_it_reads_as_a_person_would_write_it(law: Callable[[Any, Any], Any], text: str) -> None:
    assert written(law(Formula("a"), Formula("b"))) == text


def test_all_parameters_of_a_fitted_law_are_printed() -> None:
    values = {"slope_per_m": 2.0, "bend_per_m2": -10.0, "curl_per_m3": 0.0, "reach_m": 0.05, "middle_m": 0.01}
    text = "friction scale = 1 + 2 y - 10 y^2, r = x - 0.01, y = r/sqrt(1 + (r/0.05)^2)"
    assert text_of(LumenTaper, values) == text


def test_a_branch_on_a_formula_is_refused() -> None:
    with pytest.raises(TypeError, match=r"np\.where"):
        bool(Formula("a") > 0)
