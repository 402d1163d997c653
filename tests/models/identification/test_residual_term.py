"""The library of short forms: each is found again in its own curve, and knots where none holds."""

import numpy as np
import pytest
from numpy.typing import NDArray

from models.effects import shapes
from models.identification.finding import ResidualCurve
from models.identification.residual_dependence import predicted_share
from models.identification.residual_term import term_of

Z = np.linspace(0.0, 0.02, 32)


def curve(values: NDArray[np.float64], error: float = 2e-4, variable: str = "v_m_s") -> ResidualCurve:
    noise = error * np.random.default_rng(0).standard_normal(len(Z))
    seen = values + noise
    return ResidualCurve(variable, "-v", 0.5, Z, seen, seen - 1.96 * error, seen + 1.96 * error)


@pytest.mark.parametrize(
    ("form", "values"),
    [
        ("line", 0.5 * Z),
        ("parabola", 40.0 * (Z - 8e-3) ** 2),
        ("decay", 0.01 * np.exp(-Z / 4e-3)),
        ("step", 0.01 * np.tanh((Z - 0.012) / 1e-3)),
        ("bump", 0.01 * np.exp(-0.5 * ((Z - 0.012) / 2e-3) ** 2)),
        ("wave", 0.01 * np.sin(2 * np.pi * Z / 6e-3 + 1.0)),
        ("line_and_decay", 0.01 * np.exp(-Z / 2e-3) + 0.4 * Z),
    ],
)
def test_a_form_is_found_again_in_its_own_curve(form: str, values: NDArray[np.float64]) -> None:
    term = term_of(curve(values + 3e-3), "N", 0.1)
    assert term is not None
    assert term.form == form
    numbers = {name: estimate.value for name, estimate in term.numbers.items()}
    shape = getattr(shapes, form)(Z, **numbers, **term.given)
    again = term.amplitude.value * (term.offset + shape)
    np.testing.assert_allclose(again, values + 3e-3, atol=6e-4)
    low, high = term.amplitude.ci95
    assert low < term.amplitude.value < high
    assert term.text.startswith("F_extra = -sgn(v) (")


def test_a_curve_of_no_short_form_gets_knots() -> None:
    values = 0.01 * np.sign(np.sin(2 * np.pi * Z / 9e-3)) * (1 + 100 * Z)
    term = term_of(curve(values), "N", 0.1)
    assert term is not None
    assert term.form == "knots"
    places, heights = (np.atleast_1d(term.given[name]) for name in ("places", "values"))
    np.testing.assert_allclose(
        shapes.knots(Z, tuple(places), tuple(heights)), np.interp(Z, places, heights), atol=1e-12
    )


def test_a_signal_that_no_effect_sees_gets_no_term() -> None:
    assert term_of(curve(Z, variable="a_m_s2"), "N", 0.1) is None


def test_a_curve_predicts_only_what_other_folds_have_too() -> None:
    rng = np.random.default_rng(1)
    cell, fold = np.tile(np.arange(8), 200), np.repeat(np.arange(2), 800)
    noise = rng.standard_normal(1600)
    assert predicted_share(cell, noise, fold) < 0.02
    assert predicted_share(cell, noise + 3 * np.sin(cell), fold) > 0.7
    alone = np.where(fold == 0, 3 * np.sin(cell), -3 * np.sin(cell))
    assert predicted_share(cell, noise + alone, fold) == 0.0
