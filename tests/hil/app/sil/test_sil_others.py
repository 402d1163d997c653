"""Over the bus, too, a broken model hands over to one beside it that predicts better, and the log replays it."""

import json
from pathlib import Path
from typing import Any

import pytest

from hil.app.main import run
from hil.app.scenario.scenario import load_track_scenario
from hil.app.track.loop import believed_model
from hil.log.place import record_path
from models.identification import Model
from models.theta import Theta

SCENARIO = """
[scenario]
name = "slippery"
duration_s = 20.0
seed = 1
[rig]
kind = "magnetic"
[tissue]
preset = "jejunum"
[localisation]
std = 1e-4
[reference]
kind = "sine"
amplitude_mm = 12.0
frequency_Hz = 0.2
"""
STICKY = 2.5  # times the friction of the plant


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """A scenario, and a model whose last two stages have too much friction."""
    scenario, model = tmp_path / "scenario.toml", tmp_path / "model.toml"
    scenario.write_text(SCENARIO)
    nominal = believed_model(load_track_scenario(scenario), Theta()).theta
    off = nominal | Theta({"friction_coefficient": STICKY * nominal["friction_coefficient"]})
    model.write_text(Model("magnetic", {"nominal": nominal, "calibrated": off, "augmented": off}, "named").to_toml())
    return scenario, model


def found(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    capsys.readouterr()
    run([*words, "--json"])
    return dict(json.loads(capsys.readouterr().out))


@pytest.mark.slow
def test_the_better_model_leads_on_and_the_log_replays_it(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario, model = map(str, files)
    out = tmp_path / "out"
    led = found(capsys, "sil", scenario, "--model", model, "--out", str(out))
    by_hand = found(capsys, "sil", scenario, "--model", model, "--stage", "augmented")
    assert [one["to"] for one in led["switched"]] == ["nominal"]
    assert by_hand["switched"] == []
    assert led["tracking_rmse_m"] < 0.8 * by_hand["tracking_rmse_m"]

    log = out / "frames.blf"
    assert found(capsys, "replay", str(log))["identical"]
    record = json.loads(record_path(log).read_text())
    record_path(log).write_text(json.dumps(record | {"others": {}}))
    assert not found(capsys, "replay", str(log))["identical"]
