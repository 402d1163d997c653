"""`capsule run` leads a carriage that is a CiA 402 drive, in real time."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.app.main import run
from hil.nodes.frame_map import STANDBY
from tests.hil.app.run.deployments import deployment, rig_file
from tests.hil.app.run.plant_process import REAL_TIME, RUN_S, led


def test_the_same_controller_leads_it_in_real_time(tmp_path: Path, channel: str) -> None:
    """Two processes: `capsule run` with `[cia402]` sets the drive up, leads it through its states, and replays bit by
    bit.
    """
    pytest.importorskip("canopen", reason="needs the package canopen (extra canopen)")
    rig = rig_file(tmp_path, deployment(channel, control=REAL_TIME, more="[cia402]\nanswers_s = 5.0\n"))
    log = tmp_path / "run.blf"
    found, truth, status = led(tmp_path, channel, rig, log, "[cia402]\n")
    assert (found["ended"], status) == ("done", 0)
    assert found["refused"] == found["unsent"] == 0
    assert truth["moved_m"] == pytest.approx(2e-3 * RUN_S, abs=RUN_S * 1e-3)
    assert truth["state"] == STANDBY
    assert run(["replay", str(log)]) == 0
