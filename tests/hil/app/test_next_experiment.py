"""The next experiment as files: what close-loop writes is what track, sil and run follow with `--reference`."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hil.app.close_loop import next_toml, result_files
from hil.app.main import run
from hil.app.scenario.bus_scenario import load_sil_scenario, parse_sil_scenario
from hil.app.scenario.deployment import load_deployment, parse_deployment
from hil.app.scenario.scenario import load_track_scenario
from hil.report.closed_loop import report_html
from hil.report.numbers import report_json
from models.files.toml import parse_toml
from models.identification import Model
from models.identification.finding import NEXT_CSV, NEXT_TOML
from models.theta import Theta
from tests.hil.findings import proposal, pull_finding

ROOT = Path(__file__).parents[3]
DEPLOYMENT = ROOT / "examples" / "deployment" / "deployment.toml"


@pytest.fixture
def reference(tmp_path: Path) -> Path:
    path = tmp_path / NEXT_TOML
    path.write_text(next_toml(proposal(), "magnetic"), encoding="utf-8")
    return path


def test_files_are_written_where_something_is_proposed() -> None:
    theta = dict.fromkeys(("nominal", "calibrated", "augmented"), Theta())
    finding, model = pull_finding(seconds=2.0), Model("pull", theta)  # type: ignore[arg-type]
    assert NEXT_TOML not in result_files(finding, model)
    assert report_json(finding)["next_experiment_file"] is None
    proposed = replace(finding, proposal=proposal())
    files = result_files(proposed, model)
    assert files[NEXT_CSV].startswith("t_s,carriage_position_m\n")
    told = report_json(proposed)
    assert told["next_experiment_file"] == NEXT_TOML
    assert told["next_experiment_separates"][0]["standard_deviations"] == 12.4
    page = report_html(proposed)
    assert page.index('id="error"') < page.index('id="effect"') < page.index('id="next"')
    assert "--reference" in page


def test_a_scenario_follows_it(short: Path, reference: Path) -> None:
    short.write_text(short.read_text() + "[checks]\nrmse_mm = 1.0\n", encoding="utf-8")
    scenario = load_track_scenario(short, reference)
    assert scenario.duration_s == 10.0
    places = scenario.reference.position(np.array([0.0, 4.5, 6.0, 10.0]))
    assert places == pytest.approx([0.0, 8e-3, 8e-3, 0.5e-3], abs=1e-4)


def test_a_scenario_on_the_bus_and_a_deployment_keep_the_rest(reference: Path) -> None:
    path = ROOT / "hil" / "scenarios" / "sil_magnetic_drop.toml"
    plain, _ = load_sil_scenario(path)
    led, text = load_sil_scenario(path, reference)
    assert led.faults == plain.faults
    assert led.loop.truth == plain.loop.truth
    assert parse_sil_scenario(parse_toml(text, "scenario")).faults == plain.faults
    deployment = load_deployment(DEPLOYMENT, reference)
    assert deployment.control.duration_s == 10.0
    assert deployment.reference.positions.max() == pytest.approx(8e-3)
    again = parse_deployment(deployment.text, deployment.values)
    assert np.array_equal(again.reference.positions, deployment.reference.positions)
    assert again.limits == deployment.limits


def test_track_runs_it(short: Path, reference: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["track", str(short), "--reference", str(reference), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["tracking_rmse_m"] < 2e-3


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[reference]\nkind = 'ramp'\nspeed_mm_s = 1\n", "must have a table [reference] of kind 'waypoints'"),
        ("[reference]\nkind = 'waypoints'\ntimes_s = [1.0]\n", "[reference] must have positions_mm"),
        ("[reference]\nkind = 'waypoints'\ntimes_s = ['a']\npositions_mm = [1]\n", "must be a finite number"),
        ("reference = 1\n", "must have a table [reference]"),
        ("t_s,position_m\n0,0\n", "must be TOML"),
    ],
)
def test_what_is_no_reference_is_refused(
    short: Path, tmp_path: Path, text: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "other.toml"
    file.write_text(text, encoding="utf-8")
    assert run(["track", str(short), "--reference", str(file)]) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert str(file) in said
