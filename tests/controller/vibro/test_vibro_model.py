"""The drive's model, map and optimiser: reference speeds, plant, symmetry, energy balance, cheaper than squares, gears
that hold.
"""

import numpy as np
import pytest

from controller.limits import Limits
from controller.vibro.cycles import Cycles, VibroModel
from controller.vibro.drive_map import MAPS, DriveMap, best_square, free_period, lag, speed_map, wrong_models
from controller.vibro.gears import gear_of
from controller.vibro.optimal_cycle import optimal_cycle
from controller.vibro.waveform import Waveform
from models.rigs.reader import parse_rig
from models.theta import Theta
from plant import layout as at
from plant.experiments.profile import pulse_width
from plant.rig import Plant
from tests.bench.four_phase import four_phase, profile
from tests.controller.vibro.vibro_runs import GUT_DRIVE, gut_model, gut_plant, plate_model

NEAR = Waveform.square(0.053, 0.25, 0.25)


@pytest.fixture(scope="module")
def gut() -> Cycles:
    return Cycles(gut_model())


@pytest.fixture(scope="module")
def plate() -> Cycles:
    return Cycles(plate_model())


@pytest.mark.parametrize(("period", "duty", "speed"), [(0.060, 0.3, -8.275e-3), (0.097, 0.14, 19.625e-3)])
def test_the_plate_gives_the_exact_solver_s_speeds(plate: Cycles, period: float, duty: float, speed: float) -> None:
    assert plate.gait(Waveform.square(period, duty), 4.0, 4.0).speed_m_s == pytest.approx(speed, rel=0.01)


@pytest.mark.parametrize(("period", "duty", "amplitude"), [(0.053, 0.25, 0.25), (0.053, 0.7, 0.4), (0.096, 0.2, 0.3)])
def test_the_gut_gives_the_plant_s_speeds(gut: Cycles, period: float, duty: float, amplitude: float) -> None:
    rows = Plant(gut_plant()).advance(amplitude * GUT_DRIVE.force_N * pulse_width(period, duty, 24 * period, 2e-5), 5)
    x = np.interp([12 * period, 24 * period], rows[:, at.O_T], rows[:, at.O_X])
    gait = gut.gait(Waveform.square(period, duty, amplitude), 12 * period, 12 * period)
    assert gait.speed_m_s == pytest.approx((x[1] - x[0]) / (12 * period), rel=0.05, abs=2e-4)


def test_turned_over_levels_go_as_fast_the_other_way(gut: Cycles) -> None:
    there, back = gut.gait(NEAR), gut.gait(NEAR.flipped())
    assert back.speed_m_s == pytest.approx(-there.speed_m_s, rel=0.02)
    assert back.work_W == pytest.approx(there.work_W, rel=0.05)


def test_the_coil_s_work_goes_into_friction_and_damping(plate: Cycles) -> None:
    wave = Waveform.square(0.097, 0.14)
    gait = plate.gait(wave, 4.0, 4.0)
    path = np.diff(plate.path(wave, 60))[-10 * 1617 :]
    friction = 0.29 * (0.193 + 0.074) * 9.81 * np.abs(path).sum() / (path.size * 0.097 / 1617)
    assert gait.work_W == pytest.approx(friction, rel=0.02)


def test_copper_is_the_mean_square_of_the_force(gut: Cycles) -> None:
    gait = gut.gait(NEAR)
    assert gait.copper_W == pytest.approx(0.25 * (0.25 * 0.5) ** 2 / (0.5**2 / 10), rel=0.01)
    assert gut.gait(Waveform.square(0.05, 0.0)).energy_J_per_m == np.inf


def test_an_optimal_cycle_beats_the_squares_of_the_map_on_the_exact_model(gut: Cycles) -> None:
    table = speed_map(gut, (0.9, 1.0, 1.05, 1.1), (0.2, 0.25, 0.3), (0.15, 0.2, 0.25, 0.3))
    square = best_square(gut, table, 14e-3)
    assert square is not None
    optimum = optimal_cycle(gut, 14e-3, square[0], rounds=4, close=0.05)
    assert optimum is not None
    waveform, gait = optimum
    assert gait.speed_m_s == pytest.approx(14e-3, rel=0.05)
    assert gait.energy_J_per_m < 0.95 * square[1].energy_J_per_m
    assert gait.energy_J_per_m == gut.gait(waveform).energy_J_per_m


def test_an_optimal_cycle_is_found_where_a_lag_owns_a_state() -> None:
    values = Theta.of({("spring_damping", "damping_N_s_per_m"): 1.0, ("coil_lag", "time_s"): 2.0e-3, "force_N": 2.5})
    cycles = Cycles(plate_model(values))
    guess = Waveform.square(0.09, 0.2, 0.8)
    before = cycles.gait(guess)
    optimum = optimal_cycle(cycles, before.speed_m_s, guess, rounds=3, close=0.05)
    assert optimum is not None
    assert optimum[1].energy_J_per_m <= before.energy_J_per_m


def test_an_optimal_cycle_needs_a_speed(gut: Cycles) -> None:
    with pytest.raises(ValueError, match="not 0"):
        optimal_cycle(gut, 0.0, NEAR)


def test_no_gear_takes_the_body_beyond_its_speed_limit(gut: Cycles) -> None:
    gear = gear_of(gut, NEAR, 14e-3)
    assert gear is not None
    most = Limits().speed_m_s
    assert max(gut.gait(wave).peak_m_s for wave in gear.waveforms) < most
    assert gut.gait(gear.waveforms[-1].scaled(1.2)).peak_m_s > most
    assert gut.gait(gear.waveforms[-1]).peak_m_s > 5 * abs(gear.fastest_m_s)  # within a cycle it goes forth and back


def test_a_gear_gives_the_speeds_that_it_says_and_its_map_survives_the_disk(gut: Cycles) -> None:
    gear = gear_of(gut, NEAR, 14e-3)
    assert gear is not None
    assert abs(gear.slowest_m_s) < 2e-3
    assert gear.fastest_m_s > 25e-3
    for speed in (4e-3, 9e-3, 16e-3, 25e-3):
        assert gut.gait(gear.waveform(speed)).speed_m_s == pytest.approx(speed, rel=0.06)
    drive = DriveMap((gear,), lag(gut, NEAR))
    assert MAPS.validate_json(MAPS.dump_json(drive)) == drive
    assert 0.02 < drive.lag_s < 0.5


def test_wrong_parameters_change_the_speed_and_those_that_a_plate_lacks_are_left_out(plate: Cycles) -> None:
    assert len(wrong_models(plate.model)) == 4
    gaits = [Cycles(m).gait(Waveform.square(0.097, 0.14)).speed_m_s for m in wrong_models(plate.model)]
    assert np.ptp(gaits) > 1e-3


def test_four_phases_close_the_path_of_the_inner_mass_and_drive_the_body_forward(gut: Cycles) -> None:
    period = 1.05 * free_period(gut.model)
    turns = np.arange(4000) / 4000
    places, speeds, accelerations = np.array([profile(t, 0.25, period, 3e-3, 1) for t in turns]).T
    assert np.mean(accelerations) == pytest.approx(0.0, abs=0.01 * np.abs(accelerations).max())
    assert np.mean(speeds) == pytest.approx(0.0, abs=0.01 * np.abs(speeds).max())
    assert np.ptp(places) > 1e-3
    assert np.allclose(np.gradient(places, period / 4000)[1:-1], speeds[1:-1], atol=0.02 * np.abs(speeds).max())
    assert gut.gait(four_phase(gut, period, 0.25, 6e-3, 1, 0.3)).speed_m_s > 5e-3


def test_the_model_comes_from_a_rig_file_and_refuses_what_it_cannot_be() -> None:
    tables = {
        "capsule": {"mass_kg": 0.193},
        "drive": {
            "inner_mass_kg": 0.074,
            "spring_stiffness_N_per_m": 256.23,
            "force_N": 1.25,
            "reaction_on_body": True,
        },
        "surface": {"kind": "plate", "friction_coefficient": 0.29},
        "rig": {"kind": "vibro_table"},
    }
    rig = parse_rig(tables)
    values = Theta.of({"body_mass_kg": 0.193, "mirror": -1.0, ("spring_damping", "damping_N_s_per_m"): 0.5})
    model = VibroModel.from_rig(rig, values)
    assert (model.mirror, model.force_N, [e.id for e in model.effects]) == (-1.0, 1.25, ["spring_damping"])
    with pytest.raises(ValueError, match="effect must be one of the catalogue"):
        VibroModel.from_rig(rig, {("spring_dampin", "damping"): 1.0})
    with pytest.raises(ValueError, match="value must be of a parameter"):
        VibroModel.from_rig(rig, {"forc_N": 1.0})
