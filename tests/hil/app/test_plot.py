"""`capsule plot` draws records of a rig, and any CSV as it stands."""

import json
from pathlib import Path

import numpy as np
import pytest

from hil.app.main import run
from hil.report.theme import POINTS, thinned


def test_a_file_is_drawn_as_it_stands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record, page = tmp_path / "log.csv", tmp_path / "log.html"
    record.write_text("time;pos mm;note\n0,1;2,5;start\n0,2;2,6;\n")
    assert run(["plot", str(record), "--out", str(page), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["records"] == [
        {"name": "log.csv", "rows": 2, "columns": ["time", "pos mm"]}
    ]
    assert "pos mm" in page.read_text()


def test_records_of_a_rig_are_checked_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["init", "periods", str(tmp_path)]) == 0
    files = [str(tmp_path / "record.csv"), "--rig", str(tmp_path / "rig.toml"), "--out", str(tmp_path / "p.html")]
    assert run(["plot", *files]) == 0
    (tmp_path / "record.csv").write_text("a,b\n1,2\n")
    capsys.readouterr()
    assert run(["plot", *files]) == 2
    assert "record.csv" in capsys.readouterr().err


def test_nothing_to_draw_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = tmp_path / "words.csv"
    record.write_text("a,b\nx,y\n")
    assert run(["plot", str(record), "--out", str(tmp_path / "p.html")]) == 2
    assert "two columns of numbers" in capsys.readouterr().err
    assert not (tmp_path / "p.html").exists()


def test_thinning_keeps_ends_and_extremes() -> None:
    x = np.linspace(0, 1, 100_000)
    y = np.sin(40 * x)
    y[31_234] = 9.0
    kept_x, kept_y = thinned(x, y, POINTS)
    assert len(kept_x) < 5000
    assert kept_y.max() == 9.0
    assert (kept_x[0], kept_x[-1]) == (0, 1)
