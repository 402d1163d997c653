"""Power stages: a carriage, a coil and an inner mass follow their command, and how fast each is at rest."""

import math

import pytest

from hil.simulated.power_stage import CarriagePower, CoilPower, InnerMassPower
from tests.hil.ticks import SLOT, TICK


def test_carriage_reaches_each_setpoint_in_a_tick_and_brakes_within_25_ms() -> None:
    power = CarriagePower(0.25, 1.0)
    power.aim(4e-4, TICK)
    assert [power.step(SLOT, 1.0, 0.0), power.step(SLOT, 1.0, 0.0)] == pytest.approx([2e-4, 4e-4])
    power.aim(1.0, TICK)
    power.step(SLOT, 1.0, 0.0)
    assert power.rate == 0.25
    stood = 0
    while not power.at_rest:
        power.step(SLOT, 0.0, 0.0)
        stood += 1
    assert stood * SLOT <= 0.011
    here = power.output
    assert power.step(SLOT, 1.0, 0.0) == here
    power.aim(-5.0, TICK)
    for _ in range(9000):
        power.step(SLOT, 0.5, 0.0)
        assert abs(power.rate) <= 0.125
    assert power.output == -1.0


def test_coil_current_follows_and_is_gone_within_two_milliseconds() -> None:
    """An R-L coil under the current loop: 1 % after three milliseconds, below 1 % of the limit within two after the
    stop.
    """
    r, inductance, dt, i = 10.4, 10e-3, 0.5e-3, 0.0
    power = CoilPower(1.0, 10.0, inductance)

    def go(share: float, steps: int) -> None:
        nonlocal i
        for _ in range(steps):
            u = power.step(dt, share, i)
            i = u / r + (i - u / r) * math.exp(-dt * r / inductance)
            assert abs(u) <= power.supply_V

    power.aim(0.8, TICK)
    go(1.0, 10)
    assert i == pytest.approx(0.8, rel=0.01)
    go(0.5, 20)
    assert i == pytest.approx(0.5, rel=0.01)
    assert not power.at_rest
    go(0.0, 4)
    power.step(dt, 0.0, i)
    assert power.at_rest
    power.step(dt, 1.0, 1.31)
    assert power.overload


def test_inner_mass_is_off_at_once() -> None:
    power = InnerMassPower()
    power.aim(0.7, TICK)
    assert power.step(SLOT, 1.0, 1e-3) == 0.7
    assert power.step(SLOT, 0.5, 1e-3) == 0.5
    assert power.step(SLOT, 0.0, 1e-3) == 0.0
    assert power.at_rest
    assert power.step(SLOT, 1.0, 1e-3) == 0.0
