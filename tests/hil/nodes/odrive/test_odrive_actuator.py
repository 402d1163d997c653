"""An ODrive led through its adapter in simulated time, and its frames against the maker's description."""

from __future__ import annotations

import struct

import can
import cantools.database
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bus.catalogue import load_catalogue
from hil.nodes.drive.state_machine import OVER_TEMPERATURE, TIME_TO_LIVE
from hil.nodes.frame_map import ENABLE, ENABLED, FAULT, OFF, QUICK_STOP, READY, STANDBY, WAITING
from hil.nodes.odrive.actuator import FREE_NODES, SET_INPUT_POS, OdriveBus, OdriveTable, words_of
from hil.nodes.odrive.drive import OdriveDrive
from tests.hil.nodes.maker_desk import LIMITS, Desk
from tests.hil.ticks import TICK

TABLE = OdriveTable()
DESCRIBED = """VERSION ""
BU_: Master ODrive
BO_ 76 Set_Input_Pos: 8 Master
 SG_ Input_Pos : 0|32@1- (1,0) [0|0] "rev" ODrive
 SG_ Vel_FF : 32|16@1- (0.001,0) [0|0] "rev/s" ODrive
 SG_ Torque_FF : 48|16@1- (0.001,0) [0|0] "Nm" ODrive

SIG_VALTYPE_ 76 Input_Pos : 1;
"""
"""The message 0x0C of node 2 as the maker's page gives it."""


def test_a_position_is_what_the_maker_describes() -> None:
    desk = Desk(TABLE)
    desk.up()
    wire = can.Bus(interface="virtual", channel="odrive position")
    desk.bus.inner = can.Bus(interface="virtual", channel="odrive position")
    desk.say("CarriageCommand", {"Position_m": 0.0005, "TimeToLive_ms": 18, "Mode": ENABLE, "Velocity_m_s": 0.0})
    desk.say("Sync", {"Tick": 9999, "Period_s": TICK})
    told = {m.arbitration_id: m.data for m in iter(lambda: wire.recv(0), None)}
    database = cantools.database.load_string(DESCRIBED, "dbc")
    found = database.decode_message("Set_Input_Pos", told[2 << 5 | SET_INPUT_POS])
    assert found["Input_Pos"] == pytest.approx(0.05)
    assert (found["Vel_FF"], found["Torque_FF"]) == (pytest.approx(25.0), 0.0)
    desk.bus.shutdown()
    wire.shutdown()


def test_no_node_speaks_by_an_identifier_of_the_catalogue() -> None:
    own = {frame.id for frame in load_catalogue().frames.values()}
    assert not own & {node << 5 | command for node in FREE_NODES for command in range(32)}
    with pytest.raises(ValueError, match=r"odrive\.node_id must be one of 2, 3, .*; got 1"):
        OdriveTable(node_id=1)


def test_it_is_led_and_stopped() -> None:
    """Enabled only by off, ready, enable; follows; braked by positions and idle on a stop."""
    desk = Desk(TABLE)
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
        bus = OdriveBus(can.Bus(interface="virtual", channel="odrive fuzz"), TABLE, load_catalogue(), TICK)
        far.send(can.Message(arbitration_id=2 << 5 | command, is_extended_id=False, data=data))
        far.send(can.Message(arbitration_id=2 << 5 | 9, is_extended_id=False, data=struct.pack("<ff", 1e30, 1.0)))
        while bus.recv(0) is not None:
            pass
        assert isinstance(bus.trouble, str)
        bus.shutdown()
