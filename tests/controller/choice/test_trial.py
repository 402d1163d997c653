"""A trial: a model as the world with the stated localisation, and the piece of the reference that is driven."""

import math
from dataclasses import replace

import numpy as np
import pytest

from controller.choice.trial import LONGEST_S, Mission, tried
from controller.choice.world import Localisation, ModelWorld, Push
from controller.limits import Limits
from controller.model.control_model import ControlModel, control_model
from controller.reference import by_positions, through
from controller.signals import Measurement
from models.theta import Theta
from tests.controller.loops import believed, model_of

DELAYED = Theta(effects={"sensor_delay": {"delay_s": 0.1}})


def readings(
    model: ControlModel, seen: Localisation, seconds: float
) -> tuple[list[tuple[float, Measurement]], list[float]]:
    """When each reading came, the carriage moving at 2 mm/s, and where the capsule was after each tick."""
    world, came, places = (
        ModelWorld((model, Push()), seen, 1, 0.0, 0.0, 0.0),
        list[tuple[float, Measurement]](),
        list[float](),
    )
    for k in range(1, round(seconds / model.tick_s) + 1):
        now = k * model.tick_s
        came += [(now, m) for m in world.advance(2e-3 * now, now) if m.channel == "position_m"]
        places.append(float(world.state[0]))
    return came, places


def test_readings_have_the_stated_rate_noise_and_lateness() -> None:
    seen = Localisation(rate_Hz=50.0, std_m=0.2e-3, latency_s=0.03)
    came, places = readings(model_of(), seen, 4.0)
    assert np.diff([m.stamp_s for _, m in came])[1:] == pytest.approx(0.02)
    assert [now - m.stamp_s for now, m in came] == pytest.approx([0.03] * len(came), abs=1.5e-3)
    off = [m.value - places[round(m.stamp_s / 1e-3) - 1] for _, m in came]
    assert float(np.std(off)) == pytest.approx(0.2e-3, rel=0.2)


def test_a_sensor_that_delays_shows_where_the_capsule_was() -> None:
    late = control_model(believed(), DELAYED, 1e-3)
    came, places = readings(late, Localisation(std_m=0.0, latency_s=0.0), 4.0)
    last = came[-1][1]
    assert last.value == pytest.approx(places[round((last.stamp_s - 0.1) / 1e-3) - 1], abs=1e-6)


def test_a_short_reference_is_driven_whole_and_a_long_one_in_a_piece_like_it() -> None:
    slow, fast = 1e-3 * np.array([1.0, 1.0, 1.0]), 1e-3 * np.array([4.0, -4.0, 4.0])
    places = np.concatenate([[0.0], np.cumsum(np.concatenate([4.0 * slow, 4.0 * fast]))])
    reference = by_positions((4.0 * np.arange(7)).tolist(), places.tolist())
    assert Mission(reference, 5.0, Limits()).piece() == (0.0, 5.0)
    begin, end = Mission(reference, 24.0, Limits()).piece()
    assert end - begin == pytest.approx(LONGEST_S)
    speeds = reference.speed(np.arange(begin, end, 0.01))
    assert float(np.min(speeds)) < -3e-3 or float(np.max(speeds)) > 3e-3
    assert float(np.mean(np.abs(speeds - 1e-3) < 2e-4)) > 0.2


def test_a_piece_from_the_middle_tracks_like_the_beginning() -> None:
    """At another place of the lumen, at another time: the loop begins at rest there."""
    mission = Mission(through([20e-3], 2e-3, 0.5, 0.5), 11.0, Limits())
    model = model_of()
    first, later = (tried(mission, piece, model, "feedforward", (model, Push())) for piece in ((0.0, 3.0), (6.0, 9.0)))
    assert later.whole
    assert later.rmse_m < 3 * first.rmse_m


def test_a_hopeless_trial_is_given_up() -> None:
    mission, model = Mission(through([4e-3], 2e-3, 0.5, 0.5), 3.0, Limits()), model_of()
    whole = tried(mission, (0.0, 3.0), model, "feedforward", (model, Push()))
    cut = tried(mission, (0.0, 3.0), model, "feedforward", (model, Push()), whole.rmse_m / 3)
    assert not cut.whole
    assert whole.rmse_m / 3 < cut.rmse_m <= whole.rmse_m


def test_a_limit_that_the_world_breaks_is_a_violation() -> None:
    slow = replace(Limits(), speed_m_s=1e-3)
    mission, model = Mission(through([4e-3], 2e-3, 0.5, 0.5), 3.0, slow), model_of()
    assert math.isinf(tried(mission, (0.0, 3.0), model, "pid", (model, Push())).cost)


def test_a_wrong_model_tracks_worse_in_the_world_than_the_right_one() -> None:
    fold = {"depth": 0.3, "wavelength_m": 0.0073, "phase_rad": 0.4}
    folds, plain = control_model(believed(), Theta(effects={"fold_periodic": fold}), 1e-3), model_of()
    mission = Mission(through([12e-3], 3e-3, 0.5, 0.5), 5.0, Limits(), Localisation(std_m=0.1e-3))
    right, wrong = (tried(mission, (0.0, 5.0), one, "feedforward", (folds, Push())).rmse_m for one in (folds, plain))
    assert right < 0.7 * wrong


def test_a_force_that_the_model_lacks_levels_the_controllers() -> None:
    """Where the world is the model itself, a PID errs five times as much as the MPC; not where both lack 20 mN."""
    mission, model = Mission(through([12e-3], 3e-3, 0.5, 0.5), 4.0, Limits(), Localisation(std_m=0.1e-3)), model_of()
    errors = {
        (name, force_N): tried(mission, (0.0, 4.0), model, name, (model, Push(force_N, 0.5))).rmse_m
        for name in ("mpc", "pid")
        for force_N in (0.0, 20e-3)
    }
    assert errors["pid", 0.0] > 5 * errors["mpc", 0.0]
    assert errors["pid", 20e-3] < 2 * errors["mpc", 20e-3]
    assert errors["mpc", 20e-3] > 3 * errors["mpc", 0.0]


def test_a_push_has_the_stated_size_and_time() -> None:
    """Behind a magnet at rest a force along +x shows where it exceeds friction, so it is read from the world itself."""
    world, pushes = ModelWorld((model_of(), Push(5e-3, 0.2)), Localisation(), 1, 0.0, 0.0, 0.0), list[float]()
    for k in range(1, 40_001):
        world.advance(0.0, 1e-3 * k)
        pushes.append(float(world._push_N[0]))
    p = np.array(pushes)
    assert float(np.std(p)) == pytest.approx(5e-3, rel=0.15)
    assert float(np.mean(p[200:] * p[:-200]) / np.mean(p**2)) == pytest.approx(np.exp(-1), abs=0.1)
