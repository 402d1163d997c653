"""An experiment interrupts a reference at rest and goes there and back; the reference goes on later."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.reference import Excursion, Experiment, through

BEFORE = through([5e-3, 0.0], 2e-3, 2.0, 0.5)
BEGIN_S = 4.0
"""Within the rest at 5 mm."""


@given(place=st.floats(-8e-3, 8e-3), turn_s=st.floats(0.5, 5.0))
def test_the_reference_waits_for_it(place: float, turn_s: float) -> None:
    path = Experiment((0.0, turn_s, 2 * turn_s), (0.0, place, 0.0), 0.0).path
    both = Excursion(BEFORE, path, BEGIN_S)
    t = np.arange(0.0, 30.0, 1e-3)
    during = (t >= BEGIN_S) & (t < BEGIN_S + path.end_s)
    assert np.array_equal(both.position(t[t < BEGIN_S]), BEFORE.position(t[t < BEGIN_S]))
    later = t[t >= BEGIN_S + path.end_s]
    assert both.position(later) == pytest.approx(BEFORE.position(later - path.end_s), abs=1e-12)
    assert np.max(np.abs(both.position(t[during]) - 5e-3)) <= abs(place) + 1e-12
    assert np.max(np.abs(np.diff(both.position(t)) / 1e-3 - both.speed(t[:-1] + 1e-6))) < 2e-2 * abs(place) + 2e-4


@pytest.mark.parametrize(
    ("times", "places"), [((0.0, 1.0), (0.0, 1e-3)), ((0.0, 1.0, 1.0), (0.0, 1e-3, 0.0)), ((0.0,), (0.0,))]
)
def test_what_does_not_come_back_is_refused(times: tuple[float, ...], places: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="experiment must"):
        Experiment(times, places, 0.0)
