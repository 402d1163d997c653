"""Campaigns over folders of series: each closed once, whatever is killed or refused; one page that says it all."""

import html
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.app.campaign.series import find_series
from hil.app.campaign.series_answers import SeriesAnswer, answer_of, comparisons, document, lacking, with_disagreements
from hil.app.campaign.series_page import headline, page_html
from hil.app.main import run

pytestmark = pytest.mark.usefixtures("loaded_once")
AXIS = '[rig]\nkind = "axis"\n[noise]\nforce_std_N = 0.02\n'


def write_axis(folder: Path, seed: int, names: tuple[str, ...] = ("run_1", "run_2", "holdout")) -> Path:
    """A linear axis with mass, Coulomb and viscous friction, and nothing beyond."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    (folder / "rig.toml").write_text(AXIS)
    t = np.arange(0, 8, 5e-3)
    for name in names:
        w, phase = rng.uniform(2.0, 6.0, 3), rng.uniform(0, 6, 3)
        angle = np.outer(t, w) + phase
        x, v, a = (0.02 * (f * w**k).sum(1) for k, f in enumerate((np.sin(angle), np.cos(angle), -np.sin(angle))))
        force = 2.0 * a + 0.5 * np.sign(v) + 1.5 * v + 0.02 * rng.standard_normal(t.size)
        table = np.column_stack((t, x, force))
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header="t_s,position_m,force_N", comments="")
    return folder


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    """Two rigs and one whose rig file cannot be used."""
    write_axis(tmp_path / "lab" / "a", 1)
    write_axis(tmp_path / "lab" / "deep" / "b", 2)
    (write_axis(tmp_path / "lab" / "c", 3) / "rig.toml").write_text(AXIS.replace("axis", "axsi"))
    return tmp_path / "lab"


def closed(lab: Path, capsys: pytest.CaptureFixture[str], status: int, *options: str) -> dict[str, Any]:
    out = str(lab.parent / "out")
    assert run(["campaign", str(lab), "--out", out, "--workers", "1", "--json", *options]) == status
    return dict(json.loads(capsys.readouterr().out))


def rows_of(lab: Path) -> list[dict[str, Any]]:
    text = (lab.parent / "out" / "results.jsonl").read_text()
    return [json.loads(line) for line in text.splitlines()[1:]]


def test_every_series_is_closed_once_and_a_refused_one_is_a_row(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = closed(lab, capsys, 1)
    series = {one["name"]: one for one in found["series"]}
    assert list(series) == ["a", "c", "deep/b"]
    assert found["resumed"] == 0
    assert "did you mean 'axis'" in series["c"]["refused"]
    for name in ("a", "deep/b"):
        assert series[name]["part"] == "holdout"
        report = json.loads((lab.parent / "out" / "series" / name / "report.json").read_text())
        assert (report["verdict"], report["effects"]) == (series[name]["verdict"], series[name]["effects"])
        assert [r["role"] for r in report["records"]] == ["train", "train", "holdout"]
    page = (lab.parent / "out" / "campaign.html").read_text()
    assert 'href="series/deep/b/report.html"' in page
    assert "did you mean" in page
    assert json.loads((lab.parent / "out" / "campaign.json").read_text())["verdicts"] == found["verdicts"]

    before = rows_of(lab)
    assert closed(lab, capsys, 1)["resumed"] == 3
    assert rows_of(lab) == before
    (lab / "c" / "rig.toml").write_text(AXIS)
    (lab.parent / "out" / "series" / "a" / "report.html").unlink()
    again = closed(lab, capsys, 0)
    assert again["resumed"] == 1
    assert [row["point"]["series"] for row in rows_of(lab)[3:]] == ["a", "c"]


@pytest.mark.slow
def test_a_killed_campaign_goes_on(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = lab.parent / "out"
    child = subprocess.Popen(
        [sys.executable, "-m", "hil.app.start", "campaign", str(lab), "--out", str(out), "--workers", "1"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    file = out / "results.jsonl"
    while not (file.exists() and file.read_bytes().count(b"\n") > 1):
        assert child.poll() is None
        time.sleep(0.02)
    os.killpg(child.pid, signal.SIGKILL)
    child.wait()
    before = rows_of(lab)
    assert 1 <= len(before) < 3
    assert closed(lab, capsys, 1)["resumed"] == len(before)
    assert rows_of(lab)[: len(before)] == before
    assert sorted(row["point"]["series"] for row in rows_of(lab)) == ["a", "c", "deep/b"]


def test_what_a_folder_holds(tmp_path: Path) -> None:
    folder = write_axis(tmp_path / "a", 1, ("x", "held_out_1"))
    (folder / "answer.toml").write_text("")
    (folder / "holdout").mkdir()
    (folder / "x.csv").rename(folder / "holdout" / "y.csv")
    (folder / "z.csv.gz").write_bytes(b"")
    (one,) = find_series([tmp_path], tmp_path / "out")
    assert [path.name for path in one.train] == ["z.csv.gz"]
    assert [path.name for path in one.holdout] == ["held_out_1.csv", "y.csv"]
    (other,) = find_series([folder], tmp_path / "out", seed=1)
    assert one.name == other.name == "a"
    assert one.number != other.number


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["{lab}", "{lab}/none"], "must be a folder"),
        (["{tmp}/empty"], "must have a rig.toml in it or below it"),
        (["{lab}", "--run", "1"], "--run must be left out with folders"),
        (["{lab}", "--workers", "0"], "--workers must lie in"),
        (["{lab}/a/rig.toml", "--seed", "1"], "--seed must be left out with a campaign file"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(
    lab: Path, options: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (lab.parent / "empty").mkdir()
    words = [option.format(lab=lab, tmp=lab.parent) for option in options]
    assert run(["campaign", *words, "--out", str(lab.parent / "out")]) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1


def answer(name: str, effects: dict[str, float], held_out: float = 1.0, friction: float = 1.0) -> SeriesAnswer:
    """A made-up one: effects with their amplitudes, the held-out error of the last model."""
    row: dict[str, Any] = {
        "verdict": "named" if effects else "none",
        "kind": "pull",
        "effects": [
            {
                "id": effect,
                "equivalent": ["sensor_bias"] if effect == "incline_gravity" else [],
                "confidence": 0.9,
                "parameters": {"force_N": {"value": size, "ci95": [0.9 * size, 1.1 * size], "told": True}},
            }
            for effect, size in effects.items()
        ],
        "calibration": {"friction": {"value": friction, "ci95": [friction - 0.01, friction + 0.01], "told": True}},
        "error": {
            "unit": "N",
            "noise_floor": 0.5,
            "train": {},
            "holdout": {"nominal": 100.0, "calibrated": 10.0, "augmented": held_out},
        },
        "findings": [{"id": "clipping", "severity": "weakens"}],
    }
    return answer_of(name, {"result": row}, f"series/{name}")


def test_series_that_stand_apart_are_called_out() -> None:
    alike = [answer(f"rig_{k}", {"viscous_drag": 0.02 + 1e-4 * k}, friction=1 + 0.01 * (k % 3)) for k in range(8)]
    assert all(not one.disagrees for one in with_disagreements(alike))
    odd = [
        answer("other", {"incline_gravity": 0.02}),
        answer("much", {"viscous_drag": 0.2}),
        answer("worse", {"viscous_drag": 0.0204}, held_out=11.0),
        answer("rough", {"viscous_drag": 0.0204}, friction=2.0),
    ]
    said = {one.name: " ".join(one.disagrees) for one in with_disagreements([*alike, *odd]) if one.disagrees}
    assert "it lacks an inclined lumen or an offset of the sensor" in said["other"]
    assert "viscous_drag force_N is 0.2" in said["much"]
    assert "its held-out records" in said["worse"]
    assert "friction is 2" in said["rough"]
    assert list(said) == ["other", "much", "worse", "rough"]


def test_three_rigs_that_lack_different_things_are_not_said_to_lack_the_same() -> None:
    different = [
        answer(f"rig_{k}", {effect: 0.02}) for k, effect in enumerate(("viscous_drag", "stribeck", "stenosis"))
    ]
    (said,) = comparisons(different)
    assert "3 series with a verdict give 3 different answers" in said
    assert "none is the odd one" in said
    assert "Their numbers are compared from 5 series on." in said
    assert said in html.unescape(page_html(different))
    alike = [answer(f"rig_{k}", {"viscous_drag": 0.02}) for k in range(5)]
    (said,) = comparisons([*alike, answer("odd", {"stribeck": 0.02})])
    assert said.endswith("rigs: 5 of 6 series with a verdict lack a viscous drag.")
    assert "too few to compare" in comparisons(alike[:2])[0]
    assert comparisons([]) == []


def test_the_numbers_called_out_are_as_few_as_stated() -> None:
    rng = np.random.default_rng(0)
    alarms = 0
    for _ in range(300):
        drawn = [answer(f"rig_{k}", {}, friction=float(rng.normal(1, 0.1))) for k in range(7)]
        alarms += any(one.disagrees for one in with_disagreements(drawn))
    assert alarms <= 10


def test_the_page_says_what_there_is_to_say() -> None:
    answers = [
        answer("<b>", {"viscous_drag": 0.02}),
        answer("b", {}),
        answer_of("c", {"error": "no & never"}, ""),
    ]
    assert headline(answers) == "3 series: 1 lacks a named effect, 1 shows no missing effect and 1 could not be used"
    page = page_html(answers)
    assert "&lt;b&gt;" in page
    assert "no &amp; never" in page
    assert "times the noise floor: nominal 200, calibrated 20, augmented 2" in page
    assert lacking(answers) == [("a viscous drag", 1, 0)]
    assert [one["better"] for one in document(answers)["series"][:2]] == [100.0, 100.0]
    assert page_html([]).startswith("<!doctype html>")
