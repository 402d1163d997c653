"""The program from Python gives what the command line gives, and prints nothing."""

import json
from pathlib import Path

import numpy as np
import pytest

from hil import api
from hil.app.main import run
from models.sets import measured_path
from tests.places import ROOT, SCENARIOS


def test_identify_and_write(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What a prediction is worth is tested with `examples/notebook`."""
    rig = api.make_rig({"rig": {"kind": "dma"}})
    told: list[float] = []
    records = [api.load_record(measured_path("viscoelastic_table2_dma"), rig)]
    found = api.identify(rig, records, progress=lambda _, share: told.append(share))
    assert capsys.readouterr().out == ""
    assert found.finding.verdict == "unknown"
    assert told[-1] == 1.0
    written = found.write(tmp_path)
    assert {path.name for path in written} == {"report.html", "report.json", "model.toml"}
    assert json.loads((tmp_path / "report.json").read_text())["verdict"] == found.report()["verdict"]


def test_records_come_from_arrays_and_frames() -> None:
    rig = api.make_rig({"rig": {"kind": "dma"}})
    columns = {
        "frequency_Hz": [1.0, 2.0, 4.0],
        "storage_modulus_Pa": [1e3, 2e3, 3e3],
        "loss_modulus_Pa": [1.0, 2.0, 3.0],
    }
    record = api.make_record(columns, rig, "mine")
    assert record.name == "mine"
    frame = type("Frame", (dict,), {"columns": list(columns)})(columns)
    assert api.make_record(frame, rig).columns.keys() == columns.keys()
    with pytest.raises(ValueError, match="one length"):
        api.make_record({**columns, "loss_modulus_Pa": [1.0]}, rig)
    with pytest.raises(ValueError, match="row 1: storage_modulus_Pa must be a finite number"):
        api.make_record({**columns, "storage_modulus_Pa": [1.0, np.nan, 2.0]}, rig)
    with pytest.raises(ValueError, match="frequency_Hz must be positive"):
        api.make_record({**columns, "frequency_Hz": [1.0, -2.0, 4.0]}, rig)
    with pytest.raises(ValueError, match="loss_modulus_Pa"):
        api.make_record({key: columns[key] for key in ("frequency_Hz", "storage_modulus_Pa")}, rig)


def test_track_is_what_the_command_line_says(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    scenario = tmp_path / "ramp.toml"
    text = (SCENARIOS / "track_magnetic_ramp.toml").read_text()
    scenario.write_text(text[: text.index("[checks")].replace("duration_s = 20.0", "duration_s = 3.0"))
    found = api.track(scenario, "pid", seed=2)
    assert capsys.readouterr().out == ""
    assert run(["track", str(scenario), "--controller", "pid", "--seed", "2", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert found.scores["tracking_rmse_m"] == said["tracking_rmse_m"]
    assert len({column.shape for column in found.columns.values()}) == 1


def test_simulate_and_the_catalogue(capsys: pytest.CaptureFixture[str]) -> None:
    columns = api.simulate(SCENARIOS / "pull_over_folds.toml")
    assert set(columns) == {"t_s", "position_m", "force_N"}
    assert "stenosis" in [effect["id"] for effect in api.effects()]
    assert capsys.readouterr().out == ""
    assert api.use_effects(ROOT / "examples" / "own_effect" / "soft_bump.py") == ["soft_bump"]
    assert api.effects()[-1]["id"] == "soft_bump"
    assert api.use_effects() == []
