"""Harmonic balance: the describing function is that of Coulomb friction and a spring, and it says where a simulated
loop goes off.
"""

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from controller.design.describing_function import Describing, balances, compliance, describe, without_wall
from controller.design.study import exactly, pid_law, simulate
from controller.design.tuning import Pid, tuned_pid
from controller.model.control_model import ControlModel, control_model
from controller.model.linear import PHASES, Linear, linearise
from models.rigs.kinds import surface_of
from models.rigs.reader import parse_rig
from models.surfaces.gut import Wall
from models.theta import Theta
from tests.conftest import RIG

TICK, DELAY = 0.002, 0.015


@pytest.fixture(scope="module")
def magnetic() -> ControlModel:
    return control_model(parse_rig(tomllib.loads(RIG)), Theta(), TICK)


@pytest.fixture(scope="module")
def wall(magnetic: ControlModel) -> Describing:
    return describe(magnetic)


@pytest.fixture(scope="module")
def pid(magnetic: ControlModel) -> Pid:
    return tuned_pid([linearise(magnetic, phase) for phase in PHASES], DELAY)


def test_a_slow_small_swing_meets_coulomb_friction_and_the_walls_spring(magnetic: ControlModel) -> None:
    small, true = np.array([1e-5, 5e-5]), surface_of(magnetic.rig)
    assert isinstance(true, Wall)
    found = describe(magnetic, small, np.array([1.0]))
    resistance, _ = true.hold(0.0, {"hoop_stress_factor": 1.0, "friction_coefficient": 0.082})
    assert small * found.N[:, 0].imag == pytest.approx(np.full(2, 4 / math.pi * float(resistance)), rel=0.02)
    assert found.N[1, 0].real == pytest.approx(true.stiffness(), rel=0.1)


def test_without_a_wall_the_capsule_swings_on_the_magnet(magnetic: ControlModel) -> None:
    free = without_wall(magnetic)
    rates = free.rates()
    assert free.states == ("x", "v")
    assert np.abs(rates.imag) == pytest.approx(np.full(2, math.sqrt(25.0 / 4e-3)), rel=0.02)
    slow = compliance(free, Pid(0.0, 0.0, 0.0), np.array([0.1]), DELAY)
    assert slow.real == pytest.approx(1 / 25.0, rel=0.02)


def test_a_balance_solves_its_equation(magnetic: ControlModel, wall: Describing, pid: Pid) -> None:
    free = without_wall(magnetic)
    for one in balances(wall, free, pid, DELAY):
        G = compliance(free, pid, np.array([2 * math.pi * one.frequency_Hz]), DELAY)[0]
        force = wall.force()((np.log(one.amplitude_m), np.log(2 * np.pi * one.frequency_Hz)))
        assert abs(1 + complex(force) / one.amplitude_m * G) < 1e-6


@pytest.mark.parametrize("stronger", [1.0, 5.0])
def test_the_simulated_loop_comes_to_rest_below_the_balance_and_goes_off_beyond(
    magnetic: ControlModel, wall: Describing, pid: Pid, stronger: float
) -> None:
    law = replace(pid, K_i=stronger * pid.K_i)
    (one,) = balances(wall, without_wall(magnetic), law, DELAY)
    assert not one.stable
    exact = exactly(magnetic)
    ends = []
    for share in (0.3, 3.0):
        step = share * one.amplitude_m
        run = simulate(magnetic, pid_law(law, TICK, True), step / TICK, 1.5 * TICK, 3.0, DELAY, exact)
        ends.append(
            float(np.ptp((run.position - run.reference)[-500:])) + abs(float(run.position[-1] - run.reference[-1]))
        )
    assert ends[0] < 0.1 * one.amplitude_m
    assert ends[1] > one.amplitude_m


def test_a_relay_before_an_integrator_and_two_lags_hunts_as_textbooks_say() -> None:
    amplitude, omega = np.geomspace(1e-3, 10, 60), np.geomspace(0.1, 10, 60)
    relay = Describing(amplitude, omega, np.outer(4 / (math.pi * amplitude), np.ones(60)).astype(complex))
    h = 1e-3
    A = np.array([[1, h, 0], [0, 1 - h, h], [0, 0, 1 - h]])
    plant = Linear("slip", 0.0, 0.0, h, ("x", "v", "a"), A, np.zeros((3, 1)), np.array([[0.0], [0.0], [h]]))
    (one,) = balances(relay, plant, Pid(0.0, 0.0, 0.0), 0.0)
    assert one.stable
    assert 2 * math.pi * one.frequency_Hz == pytest.approx(1.0, rel=0.01)
    assert one.amplitude_m == pytest.approx(4 / math.pi * 0.5, rel=0.01)
