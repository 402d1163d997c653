"""A term that follows a spline inside the simulation, tried as an own effect, predicts what no fit has seen."""

import pytest

from tests.bench.bench_proposals import one


@pytest.mark.parametrize(("hidden", "most"), [("axis: a skew hump over the place", 0.5), ("axis: end springs", 0.6)])
def test_the_proposed_form_comes_from_inside_the_simulation(hidden: str, most: float) -> None:
    """The residual alone proposes a form for springs at the ends that predicts no better than none."""
    row = one(hidden)
    without, with_spline = row["costs"]
    assert with_spline < 0.2 * without
    assert row["inside"] < most * row["before"]
    assert row["inside"] < 0.95 * row["residual"]
