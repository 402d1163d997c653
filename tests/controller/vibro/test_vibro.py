"""The vibro controller on the plant: mean speeds both ways with wrong parameters, cycles whole, safe on bad input,
filter and MPC.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.signals import Estimate
from controller.vibro.controller import VibroController
from controller.vibro.cycles import Cycles
from controller.vibro.drive_map import design, lag, speed_map
from controller.vibro.gears import DriveMap, gear_of
from controller.vibro.slow_loop import AveragedMpc, ProgressFilter, Tuning, transition
from controller.vibro.waveform import Waveform
from plant.sensing import Instrument
from plant.session import Instruments
from tests.controller.vibro.vibro_runs import Steady, drive_plant, gut_model, gut_plant, plate_model, plate_plant

SHAPE = Waveform.square(0.053, 0.25, 0.25)
NOTHING = Estimate(0.0, np.zeros(1), np.zeros(1), lost=True)


@pytest.fixture(scope="module")
def gut() -> DriveMap:
    """A map of two gears, one a direction, of one square wave."""
    cycles = Cycles(gut_model())
    gears = (gear_of(cycles, SHAPE, 14e-3), gear_of(cycles, SHAPE.flipped(), -14e-3))
    return DriveMap(tuple(g for g in gears if g is not None), lag(cycles, SHAPE))


@pytest.fixture(scope="module")
def plate() -> DriveMap:
    """The capsubot's map, of squares, as `design` makes it."""
    model = plate_model()
    return design(model, optimise=False, table=speed_map(Cycles(model), (0.7, 1.3), (0.2, 0.8), (0.6, 0.8, 1.0)))


@pytest.mark.parametrize(
    ("speed", "off"),
    [
        (20e-3, {"force": 0.88, "hoop": 1.15, "mu": 1.1}),
        (-10e-3, {"spring": 1.1, "hoop": 0.85}),
        (5e-3, {"spring": 0.9, "mu": 0.85}),
        (-2e-3, {"force": 0.93, "hoop": 1.1}),
    ],
)
def test_a_commanded_mean_speed_is_kept_within_a_tenth_after_three_seconds(
    gut: DriveMap, speed: float, off: dict[str, float]
) -> None:
    drive = drive_plant(VibroController(gut), gut_plant(**off), Steady(speed), 7.0, seed=3)
    assert drive.mean_speed(3.0) == pytest.approx(speed, rel=0.1)
    assert drive.commands.min() >= 0
    assert drive.commands.max() <= 1


def test_the_loop_removes_what_the_feedforward_leaves(gut: DriveMap) -> None:
    off = gut_plant(force=0.88, hoop=1.15, mu=1.1)
    left = [
        abs(
            drive_plant(VibroController(gut, Tuning(feedback=feedback)), off, Steady(10e-3), 6.0).mean_speed(3.0)
            / 10e-3
            - 1
        )
        for feedback in (False, True)
    ]
    assert left[0] > 0.2
    assert left[1] < 0.3 * left[0]


def test_the_capsubot_goes_both_ways_on_its_plate(plate: DriveMap) -> None:
    for speed in (-10e-3, 10e-3):
        drive = drive_plant(VibroController(plate), plate_plant(force=1.05, mu=1.08), Steady(speed), 6.0)
        assert drive.mean_speed(3.0) == pytest.approx(speed, rel=0.1)


def test_whole_cycles_come_out_whatever_the_tick(gut: DriveMap) -> None:
    wave = gut.choose(15e-3).waveform
    for tick in (1e-3, 2.3e-3):
        controller = VibroController(gut, Tuning(tick_s=tick, feedback=False))
        ticks = round(1.06 / tick)
        levels = [controller.act(k * tick, NOTHING, Steady(15e-3)).command for k in range(ticks)]
        assert np.mean(levels) == pytest.approx(np.mean(wave.sampled(1000)), rel=0.03)
        assert controller.waveform == wave


def test_the_waveform_changes_at_the_end_of_a_cycle_only(gut: DriveMap) -> None:
    controller = VibroController(gut, Tuning(feedback=False))
    controller.act(0.0, NOTHING, Steady(10e-3))
    first = controller.waveform
    changed = next(k for k in range(1, 200) if _waveform(controller, k, -10e-3) != first)
    assert changed * 1e-3 == pytest.approx(first.period_s, abs=1.01e-3)


def _waveform(controller: VibroController, tick: int, speed: float) -> Waveform:
    controller.act(tick * 1e-3, NOTHING, Steady(speed))
    return controller.waveform


def test_beyond_reach_it_is_limited_blind_it_rests_and_recovers(gut: DriveMap) -> None:
    controller = VibroController(gut, Tuning(blind_s=0.3))
    assert controller.act(0.0, Estimate(0.0, np.zeros(1), np.zeros(1)), Steady(1.0)).status == "limited"
    answers = [controller.act(k * 1e-3, NOTHING, Steady(10e-3)) for k in range(1, 600)]
    assert answers[-1].status == "lost"
    assert answers[-1].command == 0.0
    seen = Estimate(0.6, np.array([3e-3]), np.zeros(1))
    assert [controller.act(0.6 + k * 1e-3, seen, Steady(10e-3)).status for k in range(40)][-1] == "ok"


ANY = st.floats(allow_nan=True, allow_infinity=True)


@settings(max_examples=40)
@given(ticks=st.lists(st.tuples(ANY, ANY, ANY, st.booleans()), min_size=1, max_size=40))
def test_no_input_makes_it_raise_or_leave_the_range(
    gut: DriveMap, ticks: list[tuple[float, float, float, bool]]
) -> None:
    controller = VibroController(gut)
    for k, (position, stamp, speed, lost) in enumerate(ticks):
        action = controller.act(7e-3 * k, Estimate(stamp, np.array([position]), np.zeros(1), lost=lost), Steady(speed))
        assert 0 <= action.command <= 1


def test_a_gap_of_the_localisation_does_no_harm(gut: DriveMap) -> None:
    instruments = Instruments(localisation=Instrument(gaps_s=(3.0, 0.7), outlier_share=0.03, outlier_size=20e-3))
    drive = drive_plant(VibroController(gut), gut_plant(mu=1.1), Steady(10e-3), 7.0, instruments=instruments)
    assert drive.mean_speed(3.0) == pytest.approx(10e-3, rel=0.1)


def test_the_filter_finds_a_bias_through_noise_and_outliers() -> None:
    rng = np.random.default_rng(2)
    found = ProgressFilter(lag_s=0.1)
    for k in range(1, 400):
        found.predict(0.01 * k, 5e-3)
        found.correct(3.5e-3 * 0.01 * k + 0.5e-3 * rng.standard_normal() + (30e-3 if k % 37 == 0 else 0.0))
    assert found.z[2] == pytest.approx(-1.5e-3, abs=0.2e-3)
    assert np.allclose(found.P, found.P.T, atol=1e-12)
    assert np.linalg.eigvalsh(found.P).min() > -1e-15


@given(h=st.floats(1e-3, 0.5), lag_s=st.floats(0.02, 0.6), u=st.floats(-0.05, 0.05))
def test_the_averaged_motion_composes(h: float, lag_s: float, u: float) -> None:
    F, g = transition(h, lag_s)
    G, k = transition(2 * h, lag_s)
    z = np.array([1e-3, 4e-3, -1e-3])
    assert np.allclose(F @ (F @ z + g * u) + g * u, G @ z + k * u, atol=1e-12)


def test_the_plan_is_offset_free_and_keeps_its_bounds() -> None:
    mpc = AveragedMpc(0.1)
    ahead = 0.1 * np.arange(1, 13)
    steady = mpc.plan(np.array([0.0, 12e-3, -2e-3]), 12e-3, 10e-3 * ahead, np.full(12, 10e-3), 0.0, 50e-3)
    assert np.allclose(steady, 12e-3, atol=1e-6)
    held = mpc.plan(np.array([0.0, 0.0, -30e-3]), 0.0, 10e-3 * ahead, np.full(12, 10e-3), 0.0, 25e-3)
    assert held.max() <= 25e-3 + 1e-15
    assert held[-1] == pytest.approx(25e-3)
    free = mpc.plan(np.array([2e-3, 0.0, 0.0]), 0.0, 0 * ahead, np.zeros(12), -1.0, 1.0)
    bound = mpc.plan(np.array([2e-3, 0.0, 0.0]), 0.0, 0 * ahead, np.zeros(12), -1e-3, 1.0)
    assert free.min() < -1e-3
    assert bound.min() == pytest.approx(-1e-3)
