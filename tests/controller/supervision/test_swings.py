"""A loop that swings about its reference is calmed; a large error on one side, and stick and slip, are not swings."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from controller.drives import COIL, envelope_of
from controller.feedforward import Feedforward
from controller.signals import Estimate
from controller.step import library
from controller.supervision.fallback import Swings
from controller.supervision.supervisor import Supervisor
from hil.app.scenario.reference import Steps
from hil.app.scenario.scenario import load_track_scenario
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import score
from models.theta import Theta
from plant import layout as at
from tests.controller.supervision.supervisor_stubs import DT, Ramp, Stub, estimate, magnetic, run, steady

RAMP = Path(__file__).parents[3] / "hil" / "scenarios" / "track_coil_ramp_2.toml"


def swings_of(errors_m: np.ndarray) -> int:
    swings = Swings(2e-3, 1.5)
    return max(swings.see(k * DT, float(e)) for k, e in enumerate(errors_m))


@pytest.mark.parametrize(("amplitude_m", "period_s", "count"), [(3e-3, 1.0, 11), (1.9e-3, 1.0, 0), (3e-3, 8.0, 0)])
def test_swings_are_far_and_soon(amplitude_m: float, period_s: float, count: int) -> None:
    t = np.arange(0.0, 6.0, DT)
    assert swings_of(amplitude_m * np.sin(2 * math.pi * t / period_s)) == count


def test_an_error_on_one_side_noise_and_no_number_are_none() -> None:
    t = np.arange(0.0, 6.0, DT)
    noise = np.random.default_rng(1).normal(0.0, 3e-4, t.size)
    assert swings_of(8e-3 * np.abs(np.sin(6 * t)) + noise) == 0
    assert swings_of(np.full(t.size, math.nan)) == 0


@pytest.mark.parametrize(("rate_1_s", "grows"), [(0.6, True), (0.0, False), (-0.5, False)])
def test_swings_that_grow_are_told_before_they_are_far(rate_1_s: float, grows: bool) -> None:
    swings, t = Swings(2e-3, 1.5), np.arange(0.0, 4.0, DT)
    errors = 0.6e-3 * np.exp(rate_1_s * t) * np.sin(2 * math.pi * t)
    told = [
        k
        for k, (now, e) in enumerate(zip(t, errors, strict=True))
        if swings.see(float(now), float(e)) < 1 and swings.growing
    ]
    assert bool(told) == grows
    assert not told or abs(errors[: told[0] + 1]).max() < 2e-3, "before one swing is counted"


def swinging(now: float) -> Estimate:
    return estimate(now, 4e-3 * math.sin(2 * math.pi * now))


@dataclass
class Calms(Stub):
    """One that can calm down so many times."""

    times: int = 1

    def calm(self) -> bool:
        self.times -= 1
        return self.times >= 0


def led(first: Stub, believed: Callable[[float], Estimate], seconds: float) -> Supervisor:
    supervisor = magnetic(first, steady("second", 0.0))
    run(supervisor, round(seconds / DT), believed=believed, reference=Ramp(0.0))
    return supervisor


def test_who_swings_is_calmed_and_has_failed_where_it_cannot() -> None:
    supervisor = led(Calms("first", steady("first", 0.0).answer), swinging, 5.0)
    told = [(event.after, event.reason) for event in supervisor.events if "swings" in event.reason]
    assert told[:2] == [("first", "first swings about the reference"), ("second", "first swings about the reference")]
    assert "second" in {event.after for event in led(steady("first", 0.0), swinging, 3.0).events}
    still = led(steady("first", 0.0), estimate, 3.0)
    assert not [event for event in still.events if "swings" in event.reason]


def test_feedforward_calms_down_to_a_sixteenth_of_its_pace() -> None:
    scenario = load_track_scenario(RAMP)
    model = believed_model(scenario, Theta())
    loop = Feedforward(model, envelope_of(model.drive, scenario.limits))
    assert [loop.calm() for _ in range(5)] == [True] * 4 + [False]
    assert loop.loop.gain_1_s == COIL.correction.gain_1_s / 16
    assert loop.loop.most_m_s == COIL.correction.most_m_s / 16


def test_a_coil_whose_localisation_is_later_than_it_knows_comes_to_swing_less(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = load_track_scenario(RAMP)
    seconds = 44.0
    scenario = replace(
        plain,
        duration_s=seconds,
        reference=Steps(positions_mm=[18.0, 0.0] * 4, speed_mm_s=4.0).trajectory(seconds),
        instruments=replace(plain.instruments, localisation=replace(plain.instruments.localisation, std=2e-4)),
        truth=replace(plain.truth, hidden={"sensor_delay": {"time_s": 0.08, "onset_s": 2.0}}),
        control=plain.control.but(tick_s=4e-3),
    )

    def late_rms(seed: int) -> float:
        trace = run_loop(scenario, believed_model(scenario, Theta()), "feedforward", seed)
        t, x = trace.rows[:, at.O_T], trace.rows[:, at.O_X]
        error = (x - scenario.reference.position(t))[t > seconds - 8]
        assert score(scenario, trace).hard_violations == 0
        return float(np.sqrt(np.mean(error**2)))

    calmed = np.median([late_rms(seed) for seed in (1, 2, 3)])
    monkeypatch.setattr(library, "compiler", lambda: None)
    monkeypatch.setattr(Supervisor, "_watch_swings", lambda self, seen, reference: None)
    assert calmed < 0.75 * np.median([late_rms(seed) for seed in (1, 2, 3)])
