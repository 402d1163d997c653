"""The example record: what the README says comes out, comes out."""

import json
import re
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
    quoted = re.search(r"falls from ([0-9.]+) mN \(calibrated\) to ([0-9.]+) mN", (FOLDER / "README.md").read_text())
    assert quoted is not None
    assert [f"{1e3 * errors[stage]:.1f}" for stage in ("calibrated", "augmented")] == [*quoted.groups()]
    model, out = str(tmp_path / "out" / "model.toml"), tmp_path / "prediction.csv"
    assert run(["predict", str(held), "--rig", rig, "--model", model, "--out", str(out)]) == 0
    assert len(out.read_text().splitlines()) == len(held.read_text().splitlines())
    capsys.readouterr()
    assert run(["predict", str(held), "--rig", rig, "--model", model, "--out", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["error"]["force_N"]
    assert told["value"] == pytest.approx(errors["augmented"], rel=1e-9)
    assert (told["unit"], told["measure"]) == (report["error"]["unit"], report["error"]["measure"])


def test_the_lines_of_the_api_page_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for path in FOLDER.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.chdir(tmp_path)
    found = re.search(r"```python\n(from hil import api.*?)```", (ROOT / "docs" / "api.md").read_text(), re.DOTALL)
    assert found is not None
    exec(found[1], {})
    assert "named ['fold_periodic']" in capsys.readouterr().out
    assert (tmp_path / "out" / "report.html").exists()


def test_plot(tmp_path: Path) -> None:
    page = tmp_path / "records.html"
    records = [str(FOLDER / f"pull_{k}.csv") for k in (1, 2)]
    assert run(["plot", *records, "--rig", str(FOLDER / "rig.toml"), "--out", str(page)]) == 0
    assert "force" in page.read_text()
