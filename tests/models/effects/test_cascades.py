"""Effects in a row: what one lets through is what the next one gets."""

import numpy as np
import pytest

from models.assembly.model import assemble
from models.drives.pull import Pull
from models.effects.drive import ActuatorLag, CarriageBacklash
from models.effects.refinements import FurtherLag, FurtherLowpass
from models.effects.sensor import SensorLowpass
from models.laws.geometry import Capsule, Tissue
from models.surfaces.gut import Wall
from models.theta import Theta
from tests.models.running import run

DT = 5e-4
TIME = DT * np.arange(2000)
SPEED, FIRST_S, SECOND_S, PLAY_M = 4e-3, 0.1, 0.04, 1e-3
WALL = Wall.around(Capsule(), Tissue())


def test_two_lags_follow_a_ramp_as_the_cascade_does() -> None:
    """`x = v (t - T1 - T2 + (T1^2 exp(-t/T1) - T2^2 exp(-t/T2))/(T1 - T2))` of a ramp `v t` that begins at 0."""
    values = Theta.of({("actuator_lag", "time_s"): FIRST_S, ("further_lag", "time_s"): SECOND_S})
    x = run(assemble(WALL, Pull(), [ActuatorLag, FurtherLag]), SPEED * TIME, DT, values=values, watch="x")
    fading = (FIRST_S**2 * np.exp(-TIME / FIRST_S) - SECOND_S**2 * np.exp(-TIME / SECOND_S)) / (FIRST_S - SECOND_S)
    assert x == pytest.approx(SPEED * (TIME - FIRST_S - SECOND_S + fading), abs=2e-3 * SPEED * FIRST_S)


def test_play_behind_a_lag_takes_up_what_the_lag_lets_through() -> None:
    """On a long ramp the carriage is behind by the lag's way and half of the play."""
    values = Theta.of({("actuator_lag", "time_s"): FIRST_S, ("carriage_backlash", "play_m"): PLAY_M})
    x = run(assemble(WALL, Pull(), [ActuatorLag, CarriageBacklash]), SPEED * TIME, DT, values=values, watch="x")
    assert SPEED * TIME[-1] - x[-1] == pytest.approx(SPEED * FIRST_S + PLAY_M / 2, rel=2e-3)


def test_two_smoothings_are_late_by_the_sum_of_their_times() -> None:
    """A reading that rises and stays is late against one of them alone: the area between is the second one's time times
    the rise.
    """
    path = SPEED * np.minimum(TIME, 0.2)
    one = run(
        assemble(WALL, Pull(), [SensorLowpass]), path, DT, values=Theta.of({("sensor_lowpass", "time_s"): FIRST_S})
    )
    values = Theta.of({("sensor_lowpass", "time_s"): FIRST_S, ("further_lowpass", "time_s"): SECOND_S})
    both = run(assemble(WALL, Pull(), [SensorLowpass, FurtherLowpass]), path, DT, values=values)
    late = DT * np.cumsum(one - both)
    assert late[-1] == pytest.approx(SECOND_S * (both[-1] - both[0]), rel=0.02)
