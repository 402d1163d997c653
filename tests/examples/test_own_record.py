"""The example record: what the README says comes out, comes out."""

import json
from pathlib import Path

import pytest

from hil.app.main import run
from tests.places import ROOT

FOLDER = ROOT / "examples" / "own_record"


def test_close_loop_and_predict(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    records, rig, held = (
        [str(FOLDER / f"pull_{k}.csv") for k in (1, 2)],
        str(FOLDER / "rig.toml"),
        FOLDER / "held_out.csv",
    )
    asked = ["close-loop", *records, "--rig", rig, "--holdout", str(held), "--out", str(tmp_path / "out"), "--json"]
    assert run(asked) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["verdict"] == "named"
    (effect,) = report["effects"]
    assert effect["id"] == "fold_periodic"
    assert effect["parameters"]["wavelength_m"]["value"] == pytest.approx(7.3e-3, rel=0.02)
    errors = report["error"]["holdout"]
    assert errors["augmented"] < errors["calibrated"] / 5
    model, out = str(tmp_path / "out" / "model.toml"), tmp_path / "prediction.csv"
    assert run(["predict", str(held), "--rig", rig, "--model", model, "--out", str(out)]) == 0
    assert len(out.read_text().splitlines()) == len(held.read_text().splitlines())


def test_plot(tmp_path: Path) -> None:
    page = tmp_path / "records.html"
    records = [str(FOLDER / f"pull_{k}.csv") for k in (1, 2)]
    assert run(["plot", *records, "--rig", str(FOLDER / "rig.toml"), "--out", str(page)]) == 0
    assert "force" in page.read_text()
