"""`capsule sil`: what it prints, that its log can be replayed, and the scenarios that it takes and refuses."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from hil.app.main import run as capsule
from hil.app.scenario.bus_scenario import load_sil_scenario, parse_sil_scenario
from hil.app.sil.testbed import Bench
from plant.drives import TrueCoil, TrueVibro
from tests.hil.app.sil.sil_runs import RIGS, model_of, scenario_of
from tests.places import SCENARIOS

FILES = [*sorted(SCENARIOS.glob("track_*.toml")), *sorted(SCENARIOS.glob("sil_*.toml"))]
SHORT = """
[scenario]
name = "short"
duration_s = 0.6
[rig]
kind = "magnetic"
[reference]
kind = "ramp"
speed_mm_s = 2.0
start_s = 0.1
[control]
judged_from_s = 0.2
[[faults]]
kind = "killed"
at_s = 0.5
"""


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """Half a second on the bus, then a dead controller."""
    path = tmp_path / "short.toml"
    path.write_text(SHORT, encoding="utf-8")
    return path


def test_json_has_the_keys_that_others_rely_on(short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert capsule(["sil", str(short), "--json", "--seed", "3", "--out", str(tmp_path / "out")]) == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found) == [
        *(
            "scenario",
            "controller",
            "seed",
            "model",
            "tracking_rmse_m",
            "tracking_max_m",
            "final_error_m",
            "mean_speed_m_s",
        ),
        *(
            "reference_mean_speed_m_s",
            "wall_force_max_N",
            "effort",
            "hard_violations",
            "limit_use",
            "ticks",
            "estimator",
        ),
        *(
            "solve_ms",
            "estimate_ms",
            "real_time_factor",
            "events",
            "monitor",
            "log",
            "bus",
            "faults",
            "ended",
            "remedy",
            "led_share",
            "beyond_records",
            "switched",
        ),
    ]
    assert (found["scenario"], found["controller"], found["seed"], found["model"]) == (
        "short",
        "feedforward",
        3,
        "nominal",
    )
    assert list(found["bus"]) == ["frames", "load", "rejected"]
    assert found["bus"]["frames"] > 800
    assert 0.1 < found["bus"]["load"] < 0.32
    assert [list(fault) for fault in found["faults"]] == [["fault", "at_s", "safe_after_ms", "unsafe"]]
    assert 5 < found["faults"][0]["safe_after_ms"] <= 25
    assert json.loads((tmp_path / "out" / "sil.json").read_text(encoding="utf-8")) == found


def test_the_log_can_be_replayed_bit_by_bit(short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The controller on its own log sends the same frames again, late solutions included."""
    late = '\n[[faults]]\nkind = "late_solve"\nat_s = 0.3\nduration_s = 0.003\n'
    short.write_text(SHORT + late, encoding="utf-8")
    assert capsule(["sil", str(short), "--out", str(tmp_path / "out"), "--json"]) == 0
    log = json.loads(capsys.readouterr().out)["log"]
    assert capsule(["replay", log, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["identical"]
    assert found["ticks"] == 250


def test_summary_names_the_fault(short: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert capsule(["sil", str(short)]) == 0
    out = capsys.readouterr().out
    assert "fault at 0.5 s (killed): safe after" in out
    assert "UNSAFE" not in out


def test_a_drive_that_was_never_led_is_told(short: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = SHORT.replace("at_s = 0.5", "at_s = 0.0").replace('kind = "killed"', 'kind = "lost"\nduration_s = 5.0')
    short.write_text(text, encoding="utf-8")
    assert capsule(["sil", str(short)]) == 1
    assert "ended: the drive was never led: estimate lost" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ('kind = "killed"', "did you mean 'killed'"),
        ('kind = "ramp"', "reference.kind must be one of"),
        ("[control]", "tables must be among"),
        ('kind = "magnetic"', "to be controlled; got 'pull'"),
        ("[control]\n", "control.tick_s must be at most 0.008 s for a magnetic rig on the bus"),
    ],
)
def test_bad_scenarios_end_with_one_sentence(
    short: Path, capsys: pytest.CaptureFixture[str], change: str, words: str
) -> None:
    other = {
        'kind = "killed"': 'kind = "kiled"',
        'kind = "ramp"': 'kind = "rump"',
        "[control]": "[contrl]",
        "[control]\n": "[control]\ntick_s = 0.02\n",
    }
    short.write_text(SHORT.replace(change, other.get(change, 'kind = "pull"')), encoding="utf-8")
    assert capsule(["sil", str(short)]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_shipped_scenarios_can_be_read(path: Path) -> None:
    """Those of track too; the tick is the bus's where the file names none."""
    scenario, text = load_sil_scenario(path)
    assert scenario.loop.control.tick_s == tomllib.loads(text).get("control", {}).get("tick_s", 2e-3)


def test_bus_table_is_checked() -> None:
    with pytest.raises(ValueError, match=r"bus\.longest_s_per_s must be positive"):
        scenario_of("magnetic", 0.2, bus={"longest_s_per_s": 0.0})
    with pytest.raises(ValueError, match=r"must be a multiple of 0\.001 s"):
        parse_sil_scenario(
            {"scenario": {"name": "a", "duration_s": 1.0}, **RIGS["coil"], "control": {"tick_s": 1.5e-3}}
        )
    with pytest.raises(ValueError, match="bus must be a table"):
        scenario_of("magnetic", 0.2, bus=3)


def test_a_coil_inside_the_capsule_has_no_frame() -> None:
    scenario = scenario_of("vibro", 0.3)
    vibro = scenario.loop.truth.drive
    assert isinstance(vibro, TrueVibro)
    drive = replace(vibro, coil=TrueCoil())
    other = replace(scenario, loop=replace(scenario.loop, truth=replace(scenario.loop.truth, drive=drive)))
    with pytest.raises(ValueError, match="on the bus must be"):
        Bench(other, model_of("vibro"), "vibro", 1)
