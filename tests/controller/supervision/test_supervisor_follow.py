"""Controllers go on from what went out, not from what they asked for; one that the carriage cannot follow steps
down.
"""

import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import hil
from controller.signals import Action
from controller.supervision.fallback import Rules
from hil.app.scenario.scenario import parse_track_scenario
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import score
from models.theta import Theta
from plant import layout as at
from tests.controller.supervision.supervisor_stubs import DT, Stub, magnetic, run, steady

RAMP = (
    (Path(hil.__file__).parent / "scenarios" / "track_magnetic_ramp.toml")
    .read_text()
    .replace("duration_s = 20.0", "duration_s = 7.0")
)


@pytest.mark.parametrize(("fault", "seed"), [("gaps_s", 1), ("gaps_s", 2), ("nan_s", 3)])
def test_the_mpc_tracks_again_a_second_after_one_without_localisation(fault: str, seed: int) -> None:
    scenario = parse_track_scenario(tomllib.loads(f"{RAMP}\n[localisation]\n{fault} = [3.0, 1.0]\n"))
    trace = run_loop(scenario, believed_model(scenario, Theta()), "mpc", seed)
    times = trace.rows[:, at.O_T]
    error = (trace.rows[:, at.O_X] - scenario.reference.position(times))[times > 5.0]
    assert np.sqrt(np.mean(error**2)) < 0.15e-3
    assert trace.active[-1] == "mpc"
    assert np.max(np.abs(np.diff(trace.command))) <= 0.25e-3 * (1 + 1e-6)


def test_a_controller_is_told_what_went_out_before_it_is_asked() -> None:
    best = steady("mpc", 5e-3)
    supervisor = magnetic(best, rules=Rules(blend_s=0.0))
    before = supervisor.issued.command
    for k in range(40):
        run(supervisor, 1, start=k)
        assert best.followed == before
        before = supervisor.issued.command
    assert before > 0


def test_what_is_blended_in_is_not_told() -> None:
    """Else a controller that goes on from what it is told would add the step anew each tick."""
    best = Stub("mpc", lambda now: Action(best.followed))
    supervisor = magnetic(best, rules=Rules(blend_s=0.2))
    run(supervisor, 100, believed=lambda now: None)
    actions = run(supervisor, 300, start=100)
    assert np.ptp([action.command for action in actions]) < 1e-9


@pytest.mark.parametrize(
    ("answer", "active"),
    [
        (lambda now: 9e-3 if now % 0.1 < 0.05 else -9e-3, "pid"),
        (lambda now: 9e-3 if now % 1.0 < 0.5 else -9e-3, "mpc"),
        (lambda now: 2e-4 * (-1) ** round(now / DT), "mpc"),
    ],
    ids=["sweeping", "full-rate moves", "noise"],
)
def test_only_a_carriage_that_cannot_follow_for_long_is_a_failure(
    answer: Callable[[float], float], active: str
) -> None:
    supervisor = magnetic(Stub("mpc", lambda now: Action(answer(now))), steady("pid", 0.0), rules=Rules(retry_s=9.0))
    run(supervisor, 3000)
    assert supervisor.active == active
    if active == "pid":
        assert supervisor.events[-1].reason == "mpc limited too long: rate"


@pytest.mark.parametrize("controller", ["feedforward", "mpc"])
def test_the_magnet_keeps_a_capsule_that_a_narrow_place_holds_back(controller: str) -> None:
    """Where the estimate runs ahead of the capsule by five of its standard deviations."""
    narrow = (
        RAMP.replace("duration_s = 7.0", "duration_s = 8.0") + "\n[effects.stenosis]\nexcess = 1.0\ncentre_m = 0.006\n"
    )
    scenario = parse_track_scenario(tomllib.loads(narrow))
    assert score(scenario, run_loop(scenario, believed_model(scenario, Theta()), controller, 1)).hard_violations == 0
