"""Design: the linear plant is the model's, margins are those of closed forms, tuned loops keep what they promise."""

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from controller.baselines import LQR, augmented, lqr_gains
from controller.design.study import LoopRun, lqr_law, simulate
from controller.design.tuning import Pid, closed_loop, pid_loop, state_loop, tuned_lqr, tuned_pid
from controller.drives import envelope_of
from controller.model.control_model import ControlModel, control_model
from controller.model.linear import PHASES, Linear, linearise
from controller.signals import Array, Estimate
from models.rigs.reader import parse_rig
from models.theta import Theta
from tests.conftest import RIG

MAGNET = 'kind = "magnetic"\nmagnet_stiffness_N_per_m = 25.0\nmagnet_range_m = 0.02'
COIL = RIG.replace(
    MAGNET, 'kind = "coil"\nforce_constant_N_per_A = 0.5\ncoil_resistance_Ohm = 10.0\ncoil_inductance_H = 10e-3'
)
VIBRO = (
    RIG.replace(MAGNET, 'kind = "vibro"')
    + "[drive]\ninner_mass_kg = 1e-3\nspring_stiffness_N_per_m = 60.0\nforce_N = 0.1\nreaction_on_body ="
    " true\n[surface]\nkind = 'gut'\n"
)
TICK, DELAY = 0.002, 0.015


def model(text: str = RIG, driven: str = "") -> ControlModel:
    return control_model(parse_rig(tomllib.loads(text)), Theta(), TICK, driven=driven)


@pytest.fixture(scope="module")
def magnetic() -> ControlModel:
    return model()


@pytest.fixture(scope="module")
def plants(magnetic: ControlModel) -> tuple[Linear, ...]:
    return tuple(linearise(magnetic, phase) for phase in PHASES)


class Fixed:
    """A reference that stands at `place` or moves at `rate`."""

    def __init__(self, place: float = 0.0, rate: float = 0.0) -> None:
        self.place, self.rate = place, rate

    def position(self, t: Array) -> Array:
        return self.place + self.rate * t

    def speed(self, t: Array) -> Array:
        return np.full_like(t, self.rate)


def integrator(rate: float) -> Linear:
    """`x' = rate u`."""
    return Linear("slip", 1e-3, 0.0, TICK, ("x",), np.eye(1), np.array([[rate * TICK]]), np.zeros((1, 1)))


def test_a_stuck_wall_adds_its_stiffness_to_the_magnets(plants: tuple[Linear, ...]) -> None:
    stick, slip = plants
    gap, r = slip.command, 0.02
    magnet = 25.0 * (1 - 3 * (gap / r) ** 2) / (1 + (gap / r) ** 2) ** 3
    assert slip.holding()[1] == pytest.approx(1.0)
    assert stick.holding()[1] == pytest.approx(1 + 150 / magnet, rel=0.1)


def test_the_linear_plant_predicts_small_deviations_of_the_model(
    magnetic: ControlModel, plants: tuple[Linear, ...]
) -> None:
    stick = plants[0]
    base = magnetic.initial()
    base[magnetic.index("v")], base[magnetic.index("u")] = 1e-3, 1e-4
    small = np.array([1e-7, 1e-6])
    moved = base.copy()
    moved[:2] += small
    moved[magnetic.index("u")] += small[0]
    step = [np.asarray(magnetic.step(z, stick.command, 0.0, 0.0)).ravel()[:2] for z in (base, moved)]
    assert step[1] - step[0] == pytest.approx(stick.A @ small, rel=0.25)


def test_a_coil_behind_its_winding_keeps_the_current_as_a_state() -> None:
    plant = linearise(model(COIL, "coil_voltage_V"), "slip")
    assert plant.states == ("x", "v", ("coil", "current_A"))
    assert abs(plant.rates()[0]) < 1e-6
    assert plant.command == pytest.approx(10.0 * linearise(model(COIL), "slip").command, rel=0.02)


def test_margins_of_an_integrator_with_delay() -> None:
    rate, late = 20.0, 0.02
    plant = integrator(rate)
    loop = closed_loop("p", plant, plant.system(), late)
    m = loop.margins()
    held = 0.5 * TICK
    assert m.crossover_Hz == pytest.approx(rate / (2 * math.pi), rel=2e-3)
    assert m.phase_deg == pytest.approx(90 - math.degrees(rate * (late + held)), abs=0.3)
    assert m.gain == pytest.approx(math.pi / 2 / (rate * (late + held)), rel=0.01)
    assert m.delay_s == pytest.approx(math.pi / 2 / rate - late - held, rel=0.01)
    assert m.stable


@pytest.mark.parametrize(("share", "stable"), [(0.9, True), (1.1, False)])
def test_the_delay_margin_is_where_the_poles_leave_the_circle(share: float, stable: bool) -> None:
    plant = integrator(20.0)
    more = closed_loop("p", plant, plant.system(), 0.0).margins().delay_s
    assert closed_loop("p", plant, plant.system(), TICK * round(share * more / TICK)).stable() is stable


def test_tuned_loops_keep_the_sensitivity_they_were_tuned_for(plants: tuple[Linear, ...]) -> None:
    pid, lqr = tuned_pid(plants, DELAY), tuned_lqr(plants, plants[1], DELAY)
    for plant in plants:
        for loop in (pid_loop(plant, pid, DELAY), state_loop(plant, lqr, DELAY)):
            m = loop.margins()
            assert m.stable
            assert m.sensitivity_peak <= 1.62
            assert m.gain > 2
            assert m.phase_deg > 30


def test_less_delay_allows_a_stronger_integral(plants: tuple[Linear, ...]) -> None:
    assert tuned_pid(plants, 0.004).K_i > tuned_pid(plants, DELAY).K_i > tuned_pid(plants, 0.05).K_i


def test_a_pids_response_is_its_systems() -> None:
    pid, z = Pid(2.0, 30.0, 0.01), np.exp(1j * np.geomspace(0.01, 3, 20))
    assert pid.response(z, TICK) == pytest.approx(np.asarray(pid.system(TICK)(z)).ravel())


def test_lqr_is_stable_on_its_plant_and_bears_gain(plants: tuple[Linear, ...]) -> None:
    slip = plants[1]
    gains = lqr_gains(slip)
    A, B = augmented(slip)
    assert np.max(np.abs(np.linalg.eigvals(A - B @ np.r_[gains.K, gains.K_i][None, :]))) < 1
    assert state_loop(slip, gains, 0.0).margins().phase_deg >= 60


@pytest.mark.parametrize("text", [RIG, COIL])
def test_lqr_begins_with_the_command_in_force_and_removes_a_constant_error(text: str) -> None:
    plant = model(text)
    lqr = LQR(plant, envelope_of(plant.drive))
    start = Estimate(0.0, plant.initial(), np.zeros(4))
    lqr.reset(0.0, start, 3e-3)
    assert lqr.act(0.0, start, Fixed()).command == pytest.approx(3e-3)
    lqr.reset(0.0, start, 0.0)
    run = simulate(plant, lqr_law(lqr), 1e-3, 2.0, 8.0, 0.0)
    assert abs(run.position[-1] - 2e-3) < 5e-5


def test_lqr_holds_its_integral_where_the_command_ends() -> None:
    plant = model()
    envelope = envelope_of(plant.drive)
    lqr = LQR(plant, envelope)
    stuck = Estimate(0.0, plant.initial(), np.zeros(4))
    lqr.reset(0.0, stuck, 0.0)
    commands = [lqr.act(i * TICK, stuck, Fixed(0.01)).command for i in range(5000)]
    assert max(commands) <= envelope.gap_m
    back = [lqr.act(10 + i * TICK, stuck, Fixed(-0.001)).command for i in range(50)]
    assert back[-1] < 0


def test_lqr_answers_failed_to_what_it_cannot_use() -> None:
    plant = model()
    lqr = LQR(plant, envelope_of(plant.drive))
    bad = replace(Estimate(0.0, plant.initial(), np.zeros(4)), state=np.full(4, math.nan))
    assert lqr.act(0.0, bad, Fixed()).status == "failed"


def test_a_cycle_is_told_from_a_run_that_settles() -> None:
    t = np.arange(0, 10, 0.01)
    swings = LoopRun(t, 0 * t, 1e-4 * np.sin(2 * np.pi * t / 0.5), 0 * t).cycle()
    assert swings.hunts
    assert swings.period_s == pytest.approx(0.5, rel=0.01)
    assert swings.peak_to_peak_m == pytest.approx(2e-4, rel=0.01)
    assert not LoopRun(t, 0 * t, 1e-3 * np.exp(-t), 0 * t).cycle().hunts
    assert not LoopRun(t, 0 * t, 1e-8 * np.sin(t), 0 * t).cycle().hunts


def test_what_turns_in_every_cycle_is_not_linearised() -> None:
    with pytest.raises(ValueError, match="got 'vibro'"):
        linearise(model(VIBRO), "stick")
    with pytest.raises(ValueError, match="sensitivity peak"):
        tuned_pid((integrator(1e9),), 10.0)
