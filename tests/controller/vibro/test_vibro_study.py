"""The slow loop on paper is the one that runs: its gain margin is where filter and plan in closed loop begin to
grow.
"""

import math

import numpy as np
import pytest

from controller.vibro.gears import DriveMap, Gear
from controller.vibro.slow_loop import AveragedMpc, ProgressFilter, Tuning, transition
from controller.vibro.study import resonance, slow_loop
from controller.vibro.waveform import Waveform
from tests.controller.vibro.vibro_runs import gut_model

PERIOD_S, LAG_S, SPEED_M_S = 0.053, 0.06, 10e-3
SQUARE = Waveform.square(PERIOD_S, 0.25, 0.25)
DRIVE = DriveMap((Gear((SQUARE.scaled(0.5), SQUARE), (5e-3, 20e-3), 14e-3),), LAG_S)


def swing(slope: float, cycles: int = 600) -> float:
    """How much larger a deviation of the last fifty cycles is than one of the first, where the speed answers `slope`
    times.
    """
    share = math.sqrt(Tuning().sample_s / PERIOD_S)
    f, mpc = ProgressFilter(LAG_S, 0.5e-3 * share, ripple_m=0.5e-3 * share), AveragedMpc(LAG_S)
    F, g = transition(PERIOD_S, LAG_S)
    state, u, off = np.array([1e-6, SPEED_M_S, 0.0]), SPEED_M_S, np.zeros(cycles)
    f.start(0.0, 0.0)
    f.z[1], f.learned_at = SPEED_M_S, SPEED_M_S
    for k in range(1, cycles):
        now = k * PERIOD_S
        state = F @ state + g * (SPEED_M_S + slope * (u - SPEED_M_S))
        f.predict(now, u)
        f.correct(float(state[0]))
        ahead = np.asarray(now + mpc.step_s * np.arange(1, mpc.horizon + 1), dtype=np.float64)
        u = float(mpc.plan(f.z, u, np.asarray(SPEED_M_S * ahead), np.full(mpc.horizon, SPEED_M_S), -1.0, 1.0)[0])
        off[k] = state[0] - SPEED_M_S * now
    return float(np.abs(off[-50:]).max() / np.abs(off[200:250]).max())


def test_the_loop_bears_slopes_up_to_its_gain_margin() -> None:
    found = slow_loop(DRIVE, [], SPEED_M_S, 0.0)
    margin = found.loop.margins().gain
    assert found.loop.stable()
    assert margin > 3
    assert swing(0.85 * margin) < 0.5
    assert swing(1.15 * margin) > 2


def test_later_measurements_leave_less_margin() -> None:
    phases = [slow_loop(DRIVE, [], SPEED_M_S, delay).loop.margins().phase_deg for delay in (0.0, 0.05, 0.15)]
    assert phases[0] > phases[1] > phases[2]


def test_the_inner_mass_swings_faster_where_the_body_is_free() -> None:
    found = resonance(gut_model())
    assert found.held_Hz == pytest.approx(math.sqrt(62.0 / 4e-3) / (2 * math.pi))
    assert found.free_Hz == pytest.approx(math.sqrt(2) * found.held_Hz)
    assert found.damping == pytest.approx(0.0156 / (2 * math.sqrt(62.0 * 4e-3)))
    assert found.contact_s == pytest.approx(math.pi * math.sqrt(2e-3 / 2e4))
