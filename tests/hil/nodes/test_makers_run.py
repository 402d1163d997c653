"""`capsule run` leads another maker's drive in real time, and is told of a fault that an earlier run left."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.app.main import run
from hil.bus.catalogue import load_catalogue
from hil.nodes.actuators import ActuatorTable, carriage_bus
from hil.nodes.controller.receive import FrameReceiver
from hil.nodes.frame_map import ENABLE, FAULT, OFF, STANDBY
from hil.nodes.moteus.actuator import MoteusTable
from hil.nodes.odrive.actuator import OdriveTable
from tests.hil.app.run.deployments import deployment, rig_file
from tests.hil.app.run.plant_process import REAL_TIME, RUN_S, led
from tests.hil.nodes.maker_desk import WIRING, Desk
from tests.hil.ticks import TICK

TABLES = {
    "odrive": ("[odrive]\nenable_watchdog_endpoint = 417\nwatchdog_timeout_endpoint = 418\nanswers_s = 5.0\n", ""),
    "moteus": ("[moteus]\nanswers_s = 5.0\n", "fd = true"),
}


@pytest.mark.parametrize("maker", TABLES)
def test_it_is_led_in_real_time(maker: str, tmp_path: Path, channel: str) -> None:
    """Two processes: set up, led through its states, at rest at the end, and replayed bit by bit."""
    table, bus = TABLES[maker]
    rig = rig_file(tmp_path, deployment(channel, control=REAL_TIME, more=table, bus=bus))
    log = tmp_path / "run.blf"
    found, truth, status = led(tmp_path, channel, rig, log, table, bus)
    assert (found["ended"], status) == ("time is up", 0)
    assert found["refused"] == found["unsent"] == 0
    assert truth["moved_m"] == pytest.approx(2e-3 * RUN_S, abs=RUN_S * 1e-3)
    assert (truth["state"], truth["fault"]) == (STANDBY, 0)
    assert run(["replay", str(log)]) == 0


@pytest.mark.parametrize("table", [OdriveTable(), MoteusTable()], ids=TABLES)
def test_a_controller_that_begins_anew_is_told_of_the_fault(table: ActuatorTable) -> None:
    desk = Desk(table)
    desk.up()
    desk.until_safe(silent=True)
    desk.bus = carriage_bus(desk.bus.inner, table, load_catalogue(), TICK)
    desk.heard = FrameReceiver(desk.bus, load_catalogue(), WIRING, TICK)
    desk.ticks(30, OFF)
    assert (desk.heard.state, desk.heard.fault) == (FAULT, 4)
    desk.reset()
    desk.ticks(30, ENABLE)
    assert (desk.heard.state, desk.heard.fault, desk.bus.trouble) == (STANDBY, 0, "")
