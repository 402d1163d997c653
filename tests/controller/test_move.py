"""A move ends where it shall, at rest, within its speed and acceleration, from wherever it begins."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.reference import brake, move, rest

WAYS = st.floats(-1.0, 1.0)


@given(goal=WAYS, place=WAYS, speed=st.floats(-0.3, 0.3), fastest=st.floats(1e-3, 0.4), rate=st.floats(1e-2, 10.0))
def test_it_arrives_within_its_limits(goal: float, place: float, speed: float, fastest: float, rate: float) -> None:
    found = move(goal, place, speed, fastest, rate, 3.0)
    t = np.sort(np.concatenate((np.linspace(3.0, found.times[-1] + 1.0, 200), found.times)))
    x, v = found.position(t), found.speed(t)
    assert x[0] == pytest.approx(place, abs=1e-9)
    assert v[0] == pytest.approx(speed, abs=1e-9)
    assert x[-1] == pytest.approx(goal, abs=1e-9)
    assert v[-1] == 0
    assert np.all(np.abs(np.diff(v)) <= rate * np.diff(t) + 1e-9), "acceleration"
    assert np.all(np.abs(v) <= max(abs(speed), fastest) + 1e-9), "speed"
    assert np.all(np.abs(np.diff(x) - 0.5 * (v[1:] + v[:-1]) * np.diff(t)) <= 1e-6 + np.diff(t) ** 2 * rate)


def test_to_brake_and_to_rest() -> None:
    t = np.array([0.0, 1.0, 1.1, 9.0])
    assert rest(0.2, 1.0).position(t) == pytest.approx([0.2, 0.2, 0.2, 0.2])
    assert rest(0.2, 1.0).speed(t) == pytest.approx([0.0, 0.0, 0.0, 0.0])
    found = brake(0.0, -0.01, 0.05, 1.0)
    assert found.speed(t) == pytest.approx([0.0, -0.01, -0.005, 0.0])
    assert found.position(t)[-1] == pytest.approx(-0.001)
