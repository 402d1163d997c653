"""An ODrive led through its adapter in simulated time, and its frames against the maker's description."""

import math
import struct

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bus.catalogue import load_catalogue
from hil.drives.odrive_bus import OdriveBus
from hil.drives.odrive_protocol import FREE_NODES, OdriveTable, words_of
from hil.nodes.frame_map import (
    ENABLE,
    ENABLED,
    FAULT,
    OFF,
    OVER_TEMPERATURE,
    READY,
    STANDBY,
    TIME_TO_LIVE,
)
from hil.simulated.odrive_drive import OdriveDrive
from tests.hil.drives.maker_desk import LIMITS, Desk
from tests.hil.ticks import TICK

TABLE = OdriveTable()


def test_no_node_speaks_by_an_identifier_of_the_catalogue() -> None:
    own = {frame.id for frame in load_catalogue().frames.values()}
    assert not own & {node << 5 | command for node in FREE_NODES for command in range(32)}
    with pytest.raises(ValueError, match=r"odrive\.node_id must be one of 2, 3, .*; got 1"):
        OdriveTable(node_id=1)


def test_silence_ends_by_its_own_watchdog_and_is_latched() -> None:
    """In the stated time from full speed; told by name; only an acknowledgement and then off, ready, enable lead up."""
    desk = Desk(TABLE)
    desk.up()
    desk.ticks(50, ENABLE, 0.25)
    assert desk.until_safe(silent=True) <= TABLE.stops_s(0.25) + TICK
    desk.ticks(20, ENABLE)
    assert (desk.heard.state, desk.heard.fault) == (FAULT, TIME_TO_LIVE)
    assert desk.bus.trouble == "odrive node 2: WATCHDOG_TIMER_EXPIRED"
    desk.reset()
    desk.ticks(20, ENABLE)
    assert (desk.heard.state, desk.heard.fault, desk.drive.safe) == (STANDBY, 0, True)
    desk.place = desk.drive.power.output
    desk.up()
    assert desk.heard.state == ENABLED


def test_an_error_that_clears_by_itself_stays_latched() -> None:
    desk = Desk(TABLE)
    desk.up()
    desk.drive.heated_to_C = LIMITS.temperature_C + 1
    desk.ticks(10, ENABLE)
    assert desk.drive.safe
    desk.drive.heated_to_C = 20.0
    desk.ticks(50, OFF)
    assert isinstance(desk.drive, OdriveDrive)
    assert desk.drive.errors == 0
    assert (desk.heard.state, desk.heard.fault) == (FAULT, OVER_TEMPERATURE)
    assert "INVERTER_OVER_TEMP" in desk.bus.trouble


@pytest.mark.parametrize(
    ("change", "words"),
    [("uncalibrated", r" (NOT_CALIBRATED)"), ("silent", "")],
)
def test_closed_loop_that_is_not_entered_is_told_with_the_result(change: str, words: str) -> None:
    """A result of a failure ends asking after 0.1 s, silence after 0.5 s; what was left over from before does not."""
    desk = Desk(TABLE)
    assert isinstance(desk.drive, OdriveDrive)
    desk.drive.result = 3
    desk.ticks(20, READY)
    if change == "uncalibrated":
        desk.drive.calibrated = False
        desk.ticks(40, ENABLE)
        assert desk.bus.trouble == ""
        desk.ticks(20, ENABLE)
    else:
        desk.drive.result, desk.drive.deaf_to = 0, frozenset({0x07})
        desk.ticks(240, ENABLE)
        assert desk.bus.trouble == ""
        desk.ticks(20, ENABLE)
    assert desk.bus.trouble == f"odrive node 2: it did not enter closed loop control{words}"
    assert (desk.heard.state, desk.drive.safe) == (STANDBY, True)


def test_a_result_that_is_left_over_is_no_failure() -> None:
    desk = Desk(TABLE)
    assert isinstance(desk.drive, OdriveDrive)
    desk.drive.result = 3
    desk.up()
    assert (desk.heard.state, desk.bus.trouble) == (ENABLED, "")


def test_an_axis_that_is_taken_away_is_told_with_the_result() -> None:
    """As another master would, by the node that all hear: Set_Axis_State idle."""
    desk = Desk(TABLE)
    desk.up()
    assert isinstance(desk.drive, OdriveDrive)
    desk.drive.result = 2
    desk.drive._take(0x07, bytes((1, 0, 0, 0)))
    desk.ticks(20, ENABLE)
    assert desk.bus.trouble == "odrive node 2: it left closed loop control by itself (CANCELLED)"


def test_an_axis_that_somebody_calibrates_is_not_led_on() -> None:
    """Nor asked for closed loop control again, nor spoken to with a place that is nan."""
    desk = Desk(TABLE)
    desk.up()
    assert isinstance(desk.drive, OdriveDrive)
    desk.drive.state, desk.drive.broken = 3, True
    desk.ticks(40, ENABLE)
    assert desk.bus.trouble.startswith("odrive node 2: ")
    desk.drive.state = 8
    desk.drive._judge = lambda: None  # type: ignore[method-assign]
    desk.ticks(20, OFF)
    assert math.isfinite(desk.drive._target_m)
    assert desk.drive.state == 1


def test_an_emergency_stop_to_all_stays_until_it_is_acknowledged() -> None:
    desk = Desk(TABLE)
    desk.up()
    desk.bus.inner.send(can.Message(arbitration_id=63 << 5 | 0x02, is_extended_id=False))
    desk.ticks(50, ENABLE)
    assert desk.drive.safe
    assert desk.bus.trouble == "odrive node 2: ESTOP_REQUESTED"
    assert TABLE.orders(can.Message(arbitration_id=63 << 5 | 0x02, is_extended_id=False))
    assert not TABLE.orders(can.Message(arbitration_id=63 << 5 | 0x06, is_extended_id=False, data=bytes(8)))
    desk.reset()
    desk.ticks(20, OFF)
    assert (desk.heard.state, desk.bus.trouble) == (STANDBY, "")


def test_a_reboot_and_another_node_are_told() -> None:
    desk = Desk(TABLE)
    desk.up()
    desk.drive.boot(desk.now)
    desk.ticks(50, ENABLE)
    assert desk.drive.safe
    assert desk.bus.trouble == "odrive node 2: it booted anew"
    assert isinstance(desk.drive, OdriveDrive)
    desk.drive.node_id = 3
    desk.ticks(100, OFF)
    assert desk.bus.trouble.endswith("silent, but node 3 speaks")


def test_errors_have_the_makers_names() -> None:
    assert words_of(0x4008) == "MISSING_ESTIMATE, INVERTER_OVER_TEMP"
    assert words_of(0x80000001) == "error 0x80000000"


@given(st.integers(0, 31), st.binary(max_size=8))
def test_nothing_that_a_drive_says_raises(command: int, data: bytes) -> None:
    with can.Bus(interface="virtual", channel="odrive fuzz") as far:
        bus = OdriveBus(can.Bus(interface="virtual", channel="odrive fuzz"), TABLE, TICK)
        far.send(can.Message(arbitration_id=2 << 5 | command, is_extended_id=False, data=data))
        far.send(can.Message(arbitration_id=2 << 5 | 9, is_extended_id=False, data=struct.pack("<ff", 1e30, 1.0)))
        while bus.recv(0) is not None:
            pass
        assert isinstance(bus.trouble, str)
        bus.shutdown()
