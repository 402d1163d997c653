"""`capsule run` leads a carriage that is a CiA 402 drive, in real time."""

import json
import time
from contextlib import closing
from pathlib import Path

import pytest

from hil.app.main import run
from hil.drives.cia402_protocol import DISABLED, FAULTED, Cia402Table
from hil.nodes.frame_map import STANDBY
from tests.hil.app.run.deployments import deployment, rig_file
from tests.hil.app.run.plant_process import REAL_TIME, RUN_S, led
from tests.hil.drives.cia402_ends import Polled


@pytest.mark.slow
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


def test_a_drive_with_a_fault_is_not_led_before_it_is_acknowledged(
    tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """`run` says which and how; `reset` acknowledges it, and moves nothing."""
    more = "[cia402]\nhoming_method = 17\nhoming_speed_m_s = 0.1\n"
    rig = rig_file(tmp_path, deployment(channel, "virtual", more=more))
    with closing(Polled(channel, Cia402Table(homing_method=17, homing_speed_m_s=0.1))) as polled:
        drive = polled.drive
        drive.home_m, drive.broken = 0.05, True
        while drive.state != FAULTED:
            time.sleep(0.01)
        assert run(["run", rig, "--log", str(tmp_path / "run.blf"), "--json"]) == 2
        told = capsys.readouterr().err
        assert "cia402: node 1 must have no fault before the run; got error code 0x7300" in " ".join(told.split())
        drive.broken = False
        assert run(["run", rig, "reset", "--log", str(tmp_path / "run.blf"), "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert (found["end"], drive.state, drive.power.output) == ("reset", DISABLED, 0.0)
