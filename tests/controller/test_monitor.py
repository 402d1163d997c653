"""The monitor's arithmetic: a model that holds raises no alarm, one that does not is found, what is no evidence counts
as none.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.drives import DRIVES
from controller.estimator.base import trusting
from controller.monitor import DOUBTFUL, FIRST, MOST, Forecast, Monitor, Sum, shifted, wider
from controller.signals import Adapted, Estimate
from tests.controller.loops import model_of

Seen = tuple[float, float, Estimate]
MODEL = replace(model_of().sharp, tick_s=2e-3)
SPEED = 1.5e-3
NOISE_M = 2e-4
RIGHT = Adapted(MODEL.values, 0.0)


class Believer:
    """An estimator that is always right about the model."""

    model, offset, noise = MODEL, 0.0, replace(trusting(MODEL), position_std_m=NOISE_M)


@cache
def estimates(seconds: float) -> tuple[Seen, ...]:
    """(now, command, estimate) of the model itself behind a carriage that moves."""
    found, kernels, command = list[Seen](), MODEL.kernels, 0.0
    states = MODEL.initial().reshape(1, -1)
    for k in range(round(seconds / MODEL.tick_s)):
        now, before, command = (k + 1) * MODEL.tick_s, command, SPEED * (k + 1) * MODEL.tick_s
        tick = (now - MODEL.tick_s, MODEL.tick_s, kernels.substeps, kernels.parameters)
        kernels.run(states, MODEL.command_from(before, command), command, np.zeros(1), *tick)
        seen = (0.0,) if k % 5 == 0 else ()
        state, std = states[0].copy(), np.full(states.shape[1], 1e-4)
        found.append((now, command, Estimate(now, state, std, adapted=RIGHT, innovations=seen)))
    return tuple(found)


def watched(run: Sequence[Seen], monitor: Monitor | None = None) -> Monitor:
    monitor = monitor or Monitor(Believer())  # type: ignore[arg-type]
    for now, command, estimate in run:
        monitor.look(now, command, estimate)
    return monitor


def test_a_model_that_is_right_holds() -> None:
    health = watched(estimates(15.0)).health
    assert (health.state, health.alarms, health.change, health.since_s) == ("holds", 0, "", 0.0)
    assert health.evidence < 0.1


def test_a_push_is_a_sudden_change_and_is_dated() -> None:
    run = estimates(20.0)
    half = DRIVES["magnetic"].expected
    shift = 8 * half.miss_m
    moved = [
        (t, c, replace(e, state=e.state + np.eye(len(e.state))[0] * shift * max(t - 10.0, 0.0))) for t, c, e in run
    ]
    health = watched(moved).health
    assert (health.state, health.change, health.alarms) == ("broken", "sudden", 1)
    assert 9.0 <= health.since_s <= 11.5


def test_what_is_lacking_more_and_more_is_a_slow_change() -> None:
    def lacking(t: float) -> float:
        return -0.0012 * max(t - 20.0, 0.0)

    run = [(t, c, replace(e, disturbance_N=lacking(t))) for t, c, e in estimates(60.0)]
    health = watched(run).health
    assert (health.state, health.change) == ("broken", "slow")
    assert health.since_s >= 19.0


def test_a_steady_offset_from_the_beginning_is_what_calibration_is_for() -> None:
    run = [(t, c, replace(e, disturbance_N=-0.02)) for t, c, e in estimates(40.0)]
    assert watched(run).health.state == "holds"


def to_and_fro(late_s: float, seed: int) -> list[Seen]:
    """A capsule that is carried along, its speed turned round every 2 s; seen so much later than the model foretells
    by an estimator that holds any steady offset for its own.
    """
    rng, found, steady = np.random.default_rng(seed), list[Seen](), 0.0
    speeds = [4e-3 * (1 if (k * MODEL.tick_s) % 4 < 2 else -1) for k in range(20_000)]
    at = np.cumsum(speeds) * MODEL.tick_s
    back = round(late_s / MODEL.tick_s)
    run = MODEL.initial().reshape(1, -1)
    for k in range(1, len(speeds)):
        kernels, now = MODEL.kernels, k * MODEL.tick_s
        tick = (now - MODEL.tick_s, MODEL.tick_s, kernels.substeps, kernels.parameters)
        kernels.run(run, MODEL.command_from(at[k - 1], at[k]), at[k], np.zeros(1), *tick)
        off = at[max(k - back, 0)] - at[k] - steady
        steady += MODEL.tick_s / 0.3 * off
        seen = (off / NOISE_M + rng.standard_normal(),) if k % 5 == 0 else ()
        found.append((now, at[k], Estimate(now, run[0].copy(), np.full(run.shape[1], 1e-4), innovations=seen)))
    return found


@pytest.mark.parametrize("seed", range(3))
def test_a_capsule_that_turns_late_is_found_and_one_in_time_is_not(seed: int) -> None:
    assert watched(to_and_fro(0.0, seed)).health.evidence < DOUBTFUL
    health = watched(to_and_fro(0.08, seed)).health
    assert (health.state, health.change) == ("broken", "sudden")


def test_broken_stays_until_another_model_leads() -> None:
    run = [(t, c, replace(e, disturbance_N=-0.0012 * max(t - 20.0, 0.0))) for t, c, e in estimates(60.0)]
    monitor = watched(run)
    found = monitor.health
    assert watched(estimates(20.0), monitor).health == found
    monitor.begin(100.0, found.alarms)
    assert (monitor.health.state, monitor.health.since_s, monitor.health.alarms) == ("holds", 100.0, 1)


def test_a_resting_capsule_is_no_evidence() -> None:
    monitor = Monitor(Believer())  # type: ignore[arg-type]
    rest = Estimate(0.0, MODEL.initial(), np.full(len(MODEL.states), 1e-4), -0.05, innovations=(3.0,))
    for k in range(20_000):
        monitor.look(k * MODEL.tick_s, 0.0, rest)
    assert monitor.health.evidence == 0.0


@pytest.mark.parametrize("how", ["lost", "nan", "silent", "raises"])
def test_a_failing_sensor_is_none_of_its_business(how: str) -> None:
    run = estimates(30.0)
    bad = {
        "lost": {"lost": True},
        "nan": {"state": MODEL.initial() * math.nan},
        "silent": {"innovations": (), "disturbance_N": -0.5},
        "raises": {"std": None},
    }
    broken = [(t, c, replace(e, **bad[how]) if t > 15 else e) for t, c, e in run]  # type: ignore[arg-type]
    health = watched(broken).health
    assert (health.state, health.alarms) == ("holds", 0)


def test_a_second_without_readings_is_no_second() -> None:
    forecast = Forecast(MODEL, NOISE_M)
    found = [forecast.step(t, c, replace(e, innovations=())) for t, c, e in estimates(3.0)]
    assert not any(found)


def test_a_forecast_of_the_model_itself_is_right() -> None:
    forecast = Forecast(MODEL, NOISE_M)
    seconds = [s for t, c, e in estimates(5.0) if (s := forecast.step(t, c, e)) is not None]
    assert len(seconds) == 4
    assert all(abs(s.miss_m) < 1e-9 and s.readings >= 5 for s in seconds)
    assert sum(s.moved_m for s in seconds[2:]) == pytest.approx(2 * SPEED, rel=0.2)


@given(st.lists(st.floats(-10, 10) | st.just(math.nan) | st.just(math.inf), max_size=60))
def test_a_sum_is_a_finite_number_from_none_on(evidence: list[float]) -> None:
    one = Sum()
    for k, value in enumerate(evidence):
        one.add(value, float(k))
        assert 0 <= one.value <= MOST * (k + 1)
        assert 0 <= one.since_s <= k


def test_a_sum_remembers_the_surprise_about_its_beginning() -> None:
    one = Sum()
    for k, surprise in enumerate([1.0, 3.0, 0.5, 0.5, 0.5, 9.0]):
        one.add(1.0, float(k), surprise)
    assert (one.since_s, one.surprise) == (0.0, 3.0)
    one.add(-MOST - 60.0, 6.0, 1.0)
    one.add(1.0, 7.0, 2.0)
    assert (one.since_s, one.surprise) == (7.0, 2.0)


def test_evidence_speaks_for_a_model_that_is_right_and_against_one_that_is_not() -> None:
    sizes = np.random.default_rng(0).standard_normal(20_000)
    assert np.mean([wider(z) for z in sizes]) < -0.3
    assert np.mean([wider(3 * z) for z in sizes]) > 1
    assert np.mean([shifted(z, 1.5) for z in sizes]) < -1
    assert np.mean([shifted(z + 2, 1.5) for z in sizes]) > 1


def test_every_drive_has_thresholds_that_leave_room_for_doubt() -> None:
    assert len({driven.expected for driven in DRIVES.values()}) == 3
    assert 0 < DOUBTFUL < 1 <= FIRST
