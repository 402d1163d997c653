"""The checks of track scenarios: how they are read, judged and told, and the quick ones of the shipped scenarios."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from hil.app.main import run
from hil.app.scenario.scenario import TrackScenario, load_track_scenario, parse_track_scenario
from hil.app.track.loop import LoopTrace, believed_model, run_loop
from hil.app.track.score import score, verdicts
from models.theta import Theta
from plant import layout as at
from tests.hil.app.track.track_texts import SHORT
from tests.places import SCENARIOS

FOLDER = SCENARIOS
SHIPPED = sorted(FOLDER.glob("track_*.toml"))


def led(scenario: TrackScenario, error_mm: list[tuple[float, float]]) -> dict[str, tuple[float, bool]]:
    """Verdicts on a run whose position is off the reference by `error_mm`, (from when, how far)."""
    t = 2e-4 * np.arange(round(scenario.duration_s / 2e-4))
    trace = LoopTrace(round(scenario.duration_s / scenario.control.tick_s))
    trace.rows = np.zeros((t.size, at.O_COUNT))
    off = np.zeros_like(t)
    for begin, error in error_mm:
        off[t >= begin] = 1e-3 * error
    trace.command[:] = trace.solve_s[:] = trace.estimate_s[:] = 0.0
    trace.rows[:, at.O_T], trace.rows[:, at.O_X] = t, scenario.reference.position(t) + off
    found = verdicts(scenario, "mpc", trace, score(scenario, trace))
    return {one["check"]: (one["value"], one["passed"]) for one in found}


def scenario_of(reference: dict[str, object], checks: dict[str, object], **tables: object) -> TrackScenario:
    head = {"scenario": {"duration_s": 10.0}, "rig": {"kind": "magnetic"}}
    return parse_track_scenario({**head, "reference": reference, "checks": checks, **tables})


RAMP = {"kind": "ramp", "speed_mm_s": 1.0}
STEPS = {"kind": "steps", "positions_mm": [2.0, 4.0], "speed_mm_s": 2.0, "dwell_s": 2.0}


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_each_shipped_scenario_is_held_to_something(path: Path) -> None:
    """No hard limit may be broken, and something is asked of the controller that the scenario is for."""
    scenario = load_track_scenario(path)
    for name in ("vibro",) if scenario.kind == "vibro" else ("feedforward", "mpc"):
        checks = scenario.checks[name]
        assert checks.hard_violations == 0
        asked = (
            checks.rmse_mm,
            checks.drift_mm,
            checks.recovered_within_s,
            checks.settled_within_s,
            checks.speed_error_percent,
        )
        assert any(one is not None for one in asked)


@pytest.mark.parametrize(
    ("errors", "value", "passed"),
    [
        ([(5.0, 1.0), (6.3, 0.1)], 0.3, True),
        ([(5.0, 1.0), (6.3, 0.1), (6.9, 0.3), (7.4, 0.0)], 1.4, False),
        ([(5.0, 1.0)], math.inf, False),
        ([(2.0, 1.0), (5.0, 0.1)], 0.0, True),
    ],
)
def test_recovery_counts_from_the_end_of_the_last_drop_out_and_must_last(
    errors: list[tuple[float, float]], value: float, passed: bool
) -> None:
    """The gap ends at 6 s; what lies before it does not count."""
    scenario = scenario_of(
        RAMP, {"recovered_within_s": 1, "recovered_mm": 0.2}, localisation={"gaps_s": [5.0, 1.0, 1.0, 1.0]}
    )
    found = led(scenario, errors)["recovered_within_s"]
    assert found == (pytest.approx(value, abs=1e-3), passed)


def test_each_arrival_is_judged_until_the_next_move() -> None:
    """Arrivals at 1.5 and 4.5 s: the later to settle counts."""
    scenario = scenario_of(STEPS, {"settled_within_s": 1.0, "settled_mm": 0.2})
    assert led(scenario, [(1.0, 0.5), (2.0, 0.0), (4.0, 0.5), (5.3, 0.0)])["settled_within_s"] == (
        pytest.approx(0.75, abs=0.01),
        True,
    )
    assert not led(scenario, [(3.0, 0.5), (4.0, 0.0)])["settled_within_s"][1]


def test_drift_is_the_way_between_the_outermost_positions() -> None:
    """After the move, not during it."""
    scenario = scenario_of({"kind": "hold", "position_mm": 2.0}, {"drift_mm": 0.1, "drift_from_s": 4.0})
    assert led(scenario, [(1.0, 3.0), (4.0, -0.05), (6.0, 0.04)])["drift_mm"] == (pytest.approx(0.09), True)


def test_mean_speeds_are_judged_leg_by_leg() -> None:
    """A step of 1 mm amid the second leg's judged 2.95 s of 1 mm/s tilts the line through all positions by 1.5 mm in
    2.95 s.
    """
    reference = {"kind": "waypoints", "times_s": [0.5, 5.0, 10.0], "positions_mm": [0.0, 9.0, 4.0]}
    scenario = scenario_of(reference, {"speed_error_percent": 10, "speed_after_s": 2})
    assert led(scenario, [])["speed_error_percent"][1]
    value, passed = led(scenario, [(8.525, 1.0)])["speed_error_percent"]
    assert not passed
    assert value == pytest.approx(51, abs=2)


def test_a_controller_s_own_table_stands_over_the_common_one() -> None:
    """What it does not name it takes from there."""
    scenario = scenario_of(RAMP, {"rmse_mm": 1, "worst_mm": 2, "mpc": {"rmse_mm": 0.1}})
    assert (scenario.checks["mpc"].rmse_mm, scenario.checks["mpc"].worst_mm) == (0.1, 2)
    assert scenario.checks["pid"].rmse_mm == 1


@pytest.mark.parametrize(("limit", "status", "word"), [("1.0", 0, "passed"), ("0.0001", 1, "FAILED")])
def test_a_failed_check_is_status_1_and_stands_everywhere(
    short: Path, tmp_path: Path, limit: str, status: int, word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """On the terminal, in the JSON and on the page; with --compare one for each controller."""
    short.write_text(SHORT + f"[checks]\nrmse_mm = {limit}\n", encoding="utf-8")
    assert run(["track", str(short), "--out", str(tmp_path / "out")]) == status
    assert word in capsys.readouterr().out
    found = json.loads((tmp_path / "out" / "track.json").read_text(encoding="utf-8"))
    assert [(one["check"], one["limit"], one["passed"]) for one in found["checks"]] == [
        ("rmse_mm", float(limit), not status)
    ]
    page = (tmp_path / "out" / "track.html").read_text(encoding="utf-8")
    assert f">{word}</span>" in page
    assert "Largest use of each limit" in page


def test_comparing_judges_each_controller_by_its_own_table_and_draws_all(
    short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One controller's failed check is enough for status 1."""
    text = (
        SHORT.replace("duration_s = 2.0", "duration_s = 0.8")
        + "[checks]\nhard_violations = 0\n[checks.lqr]\nrmse_mm = 0\n"
    )
    short.write_text(text, encoding="utf-8")
    assert run(["track", str(short), "--compare", "--json", "--out", str(tmp_path / "out")]) == 1
    found = {one["controller"]: one["checks"] for one in json.loads(capsys.readouterr().out)["runs"]}
    assert len(found) == 7
    page = (tmp_path / "out" / "track.html").read_text(encoding="utf-8")
    assert {page.count(f'"name":"{name}"') for name in found} == {4}
    assert {name for name, checks in found.items() if not all(one["passed"] for one in checks)} == {"lqr"}


def test_a_lost_estimate_is_told(short: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a reading every tick is lost, and both outputs say so."""
    short.write_text(SHORT + "[localisation]\ngaps_s = [0.0, 3.0]\n[checks]\nlost_ticks = 0\n", encoding="utf-8")
    assert run(["track", str(short), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["ticks"]["lost"] == 2000
    assert run(["track", str(short)]) == 1
    assert "lost 2000" in capsys.readouterr().out


def test_readings_a_second_old_are_refused(short: Path, capsys: pytest.CaptureFixture[str]) -> None:
    short.write_text(SHORT + "[localisation]\nlatency_s = 1.0\n", encoding="utf-8")
    assert run(["track", str(short)]) == 2
    assert "younger than limits.age_s = 0.15 s" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "controller"),
    [
        ("magnetic_ramp_2", "feedforward"),
        ("magnetic_ramp_2", "mpc"),
        ("magnetic_ramp_10", "mpc"),
        ("magnetic_steps", "feedforward"),
        ("magnetic_nan", "feedforward"),
        ("magnetic_nan", "mpc"),
        ("magnetic_dropout", "feedforward"),
        ("magnetic_dropout", "mpc"),
        ("vibro_dropout", "vibro"),
        ("vibro_gut_2", "vibro"),
        ("vibro_gut_20", "vibro"),
    ],
)
def test_quick_scenarios_keep_their_checks(name: str, controller: str) -> None:
    """With the seed that they ship with."""
    scenario = load_track_scenario(FOLDER / f"track_{name}.toml")
    trace = run_loop(scenario, believed_model(scenario, Theta()), controller, scenario.seed)
    found = verdicts(scenario, controller, trace, score(scenario, trace))
    assert [one for one in found if not one["passed"]] == []
