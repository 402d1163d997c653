"""Another maker's carriage is led and stopped; from full speed on, once its controller is lost, it goes no further than
its table states.
"""

import pytest

from hil.drives.moteus_protocol import MoteusTable
from hil.drives.odrive_protocol import OdriveTable
from hil.drives.table import ActuatorTable
from hil.nodes.frame_map import ENABLE, ENABLED, OFF, QUICK_STOP, READY, STANDBY, WAITING
from tests.bench.bench_stops import stated, worst
from tests.hil.drives.maker_desk import LIMITS, Desk
from tests.hil.ticks import TICK

SPEED = LIMITS.carriage_speed_m_s


@pytest.mark.parametrize(("drive", "slows_m_s2", "told_m"), [("cia402", 25.0, 0.0025), ("odrive", 5.0, 0.0025)])
def test_the_way_to_rest_without_a_controller(drive: str, slows_m_s2: float, told_m: float) -> None:
    """The last command goes on until the drive's own watchdog ends it; a stop that is told is braked at 25 m/s2."""
    if drive == "cia402":
        pytest.importorskip("canopen", reason="needs the package canopen (extra canopen)")
    lost, most = worst(drive, SPEED, 3), stated(drive, SPEED)
    assert lost.way_m <= most.way_m + SPEED * TICK
    assert lost.time_s <= most.time_s + TICK
    assert lost.way_m >= 0.4 * SPEED**2 / (2 * slows_m_s2) + SPEED * TICK
    assert worst(drive, SPEED, 3, told=True).way_m <= told_m


@pytest.mark.parametrize("table", [OdriveTable(), MoteusTable(answers_s=0.5)], ids=lambda table: table.where)
def test_it_is_led_and_stopped(table: ActuatorTable) -> None:
    """Enabled only by off, ready, enable; follows; braked by positions and idle on a stop."""
    desk = Desk(table)
    desk.ticks(20, ENABLE)
    assert desk.heard.state == STANDBY
    desk.ticks(20, READY)
    assert desk.heard.state == WAITING
    desk.ticks(20, ENABLE)
    assert desk.heard.state == ENABLED
    desk.ticks(100, ENABLE, 0.1)
    assert desk.drive.power.output == pytest.approx(desk.place, abs=2 * 0.1 * TICK)
    assert desk.heard.report == pytest.approx(desk.drive.power.output, abs=0.1 * 3 * TICK)
    assert desk.until_safe(QUICK_STOP) <= 0.1 / 25.0 + 6 * TICK
    desk.ticks(20, OFF)
    assert (desk.heard.state, desk.bus.trouble, desk.heard.fault) == (STANDBY, "", 0)
