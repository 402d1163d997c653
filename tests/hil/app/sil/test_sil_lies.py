"""A localisation that drifts, in `capsule sil` and `track` as a user types it: stopped, told, status 1."""

import json
from pathlib import Path

import pytest

from hil.app.main import run

DRIFT = """
[scenario]
duration_s = 14.0
seed = 1
[rig]
kind = "magnetic"
magnet_stiffness_N_per_m = 24.2
magnet_range_m = 0.02
[tissue]
preset = "jejunum"
[effects.sensor_drift]
span = 1.0
time_s = 8.0
[reference]
kind = "hold"
"""


@pytest.mark.parametrize("command", ["sil", "track"])
def test_a_drift_ends_a_run(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "drift.toml").write_text(DRIFT)
    assert run([command, str(tmp_path / "drift.toml"), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["ended"].startswith("sensor or drive contradict each other: ")
    assert command == "track" or found["tracking_max_m"] < 0.02 / 3**0.5
    assert sum(found["led_share"].values()) == pytest.approx(1.0)
    assert found["led_share"]["stop"] > 0.1  # it did not lead to the end
