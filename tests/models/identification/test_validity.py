"""What the training records covered stands in the model's file, and what leaves it is told."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hil.app.main import run
from models.identification import Model
from models.identification.kinds import kind_for
from models.identification.validity import DRIVEN_AT, beyond, ranges_of
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from models.theta import Theta
from tests.rig_texts import GUT, PLATE

PULL = f'{GUT}\n[rig]\nkind = "pull"\n[noise]\nforce_std_N = 1e-3\n'
VALUES = Theta({"hoop_stress_factor": 1.0, "friction_coefficient": 0.08})
STAGES = ("nominal", "calibrated", "augmented")


def pull(far_m: float = 6e-3, period_s: float = 6.0, seconds: float = 12.0) -> Record:
    t = np.arange(0, seconds, 2e-3)
    x = far_m * (1 - np.cos(2 * np.pi * t / period_s)) * 0.5
    return Record("pull", "pull", {"t_s": 100.0 + t, "position_m": x, "force_N": np.zeros_like(t)})


def covered_by(rig: Rig, *records: Record) -> Model:
    kind = kind_for(rig, records)
    made = [r.with_column("force_N", kind.predict(r, kind.nominal() | VALUES)) for r in records]
    return replace(Model("pull", dict.fromkeys(STAGES, VALUES)), validity=ranges_of(kind, made))


def test_ranges_are_those_of_the_records_and_survive_the_file(rig: Rig) -> None:
    model = covered_by(rig, pull(), pull(far_m=9e-3))
    assert model.validity["x_m"] == pytest.approx((0, 9e-3), abs=1e-5)
    assert model.validity["v_m_s"] == pytest.approx((-9e-3 * np.pi / 6, 9e-3 * np.pi / 6), rel=0.02)
    assert model.validity["t_s"] == pytest.approx((0, 12), abs=0.01)
    assert Model.from_toml(model.to_toml()) == model


@pytest.mark.parametrize(
    ("motion", "left"),
    [
        ({}, set()),
        ({"far_m": 6.05e-3}, set()),  # within 2 % of the span
        ({"far_m": 12e-3, "period_s": 12.0}, {"x_m"}),
        ({"period_s": 3.0}, {"v_m_s", "travelled_m"}),
        ({"seconds": 24.0}, {"t_s", "travelled_m"}),
    ],
)
def test_a_prediction_tells_where_it_leaves_them(rig: Rig, motion: dict[str, float], left: set[str]) -> None:
    model, record = covered_by(rig, pull()), pull(**motion)
    found = model.beyond(rig, record, model.predict(rig, record))
    assert left <= set(found) <= left | {"force_N"}
    for ends in found.values():
        low, high = ends["covered"]
        assert ends["reached"][0] < low or ends["reached"][1] > high


def test_a_vibrating_drive_has_a_frequency() -> None:
    rig = parse_rig_text(f'{PLATE}\n[rig]\nkind = "vibro"\n')

    def shaken(hertz: float) -> Record:
        t = np.arange(0, 3, 1e-3)
        on = (np.mod(t * hertz, 1) < 0.4).astype(float)
        return Record("a", "vibro", {"t_s": t, "drive_on": on, "position_m": np.zeros_like(t)})

    ranges = [ranges_of(kind_for(rig, [shaken(f)]), [shaken(f)]) for f in (12.0, 12.1, 25.0)]
    assert ranges[0][DRIVEN_AT] == pytest.approx((12, 12), abs=0.2)
    assert set(beyond(ranges[0], ranges[1])) & {DRIVEN_AT} == set()
    assert DRIVEN_AT in beyond(ranges[0], ranges[2])


def test_the_command_says_it_in_a_sentence(rig: Rig, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "rig.toml").write_text(PULL)
    (tmp_path / "model.toml").write_text(covered_by(rig, pull()).to_toml())
    record = pull(far_m=12e-3, period_s=12.0)
    rows = zip(record["t_s"], record["position_m"], strict=True)
    (tmp_path / "far.csv").write_text("t_s,position_m\n" + "".join(f"{t:.3f},{x:.8f}\n" for t, x in rows))
    files = ["--rig", str(tmp_path / "rig.toml"), "--model", str(tmp_path / "model.toml")]
    asked = ["predict", str(tmp_path / "far.csv"), *files, "--out", str(tmp_path / "out.csv"), "--json"]
    assert run(asked) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["beyond_records"]["x_m"]["reached"][1] == pytest.approx(12e-3, rel=1e-3)
    assert "This leaves what the records of the model covered" in said.err
    assert "position 0 m to 12 mm (0 m to 6 mm)" in said.err
    assert run(["export", "table", *files, "--out", str(tmp_path / "table"), "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["beyond_records"]["v_m_s"]["reached"] == [-0.05, 0.05]
    assert "This leaves what the records of the model covered" in said.err


@pytest.mark.parametrize(("far_mm", "left"), [(5.0, False), (12.0, True)])
def test_a_closed_loop_tells_it_of_its_reference(
    far_mm: float, left: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = f"""
[scenario]
duration_s = 1.0
[rig]
kind = "magnetic"
[reference]
kind = "waypoints"
times_s = [1.0]
positions_mm = [{far_mm}]
"""
    (tmp_path / "scenario.toml").write_text(scenario)
    values = VALUES | {"magnet_stiffness_N_per_m": 25.0}
    model = replace(Model("magnetic", dict.fromkeys(STAGES, values)), validity={"x_m": (0.0, 6e-3)})
    (tmp_path / "model.toml").write_text(model.to_toml())
    asked = ["track", str(tmp_path / "scenario.toml"), "--model", str(tmp_path / "model.toml"), "--json"]
    run([*asked, "--controller", "feedforward"])
    said = capsys.readouterr()
    assert ("x_m" in json.loads(said.out)["beyond_records"]) == left
    assert ("leaves what the records" in said.err) == left


def parse_rig_text(text: str) -> Rig:
    return parse_rig(tomllib.loads(text))


@pytest.fixture
def rig() -> Rig:
    return parse_rig_text(PULL)
