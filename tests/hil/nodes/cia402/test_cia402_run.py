"""`capsule run` leads a carriage that is a CiA 402 drive, in real time."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from hil.nodes.frame_map import STANDBY
from tests.hil.app.run.deployments import deployment, rig_file
from tests.hil.app.run.plant_process import CAPSULE, REAL_TIME, RUN_S, TRIES, plant_on, truth_of


def test_the_same_controller_leads_it_in_real_time(tmp_path: Path, channel: str) -> None:
    """Two processes: `capsule run` with `[cia402]` sets the drive up, leads it through its states, and replays bit by
    bit.
    """
    pytest.importorskip("canopen", reason="needs the package canopen (extra canopen)")
    rig = rig_file(tmp_path, deployment(channel, control=REAL_TIME, more="[cia402]\nanswers_s = 5.0\n"))
    log = tmp_path / "run.blf"
    for _ in range(TRIES):
        with plant_on(tmp_path, channel, "[cia402]\n") as plant:
            command = [*CAPSULE, "run", rig, "--log", str(log), "--json"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            truth = truth_of(plant)
        assert done.stdout, done.stderr
        found = json.loads(done.stdout)
        if found["ended"] == "time is up":
            break
    assert (found["ended"], done.returncode) == ("time is up", 0)
    assert found["refused"] == found["unsent"] == 0
    assert truth["moved_m"] == pytest.approx(2e-3 * RUN_S, abs=RUN_S * 1e-3)
    assert truth["state"] == STANDBY
    replayed = subprocess.run([*CAPSULE, "replay", str(log)], capture_output=True, text=True, check=False)
    assert replayed.returncode == 0, replayed.stdout
