"""The frames of the ODrive's adapter and of its double, decoded by cantools with a DBC of the maker's messages."""

import struct
from contextlib import closing
from typing import Any

import can
import cantools.database
import pytest

from hil.drives.odrive_protocol import OdriveTable
from hil.drives.odrive_setup import set_up
from hil.nodes.frame_map import ENABLE, OFF, QUICK_STOP
from hil.simulated.medium import SimulatedBus
from hil.simulated.odrive_drive import OdriveDrive
from tests.hil.drives.maker_desk import LIMITS, Desk, Running
from tests.hil.ticks import TICK

U8, U16, U32, I16, F32 = "8@1+", "16@1+", "32@1+", "16@1-", "32@1-"
MESSAGES = {
    "Get_Version": (0x00, 8, [("Fw_Version_Major", 32, U8), ("Fw_Version_Minor", 40, U8)]),
    "Heartbeat": (
        0x01,
        8,
        [("Axis_Error", 0, U32), ("Axis_State", 32, U8), ("Procedure_Result", 40, U8), ("Trajectory_Done", 48, "1@1+")],
    ),
    "Get_Error": (0x03, 8, [("Active_Errors", 0, U32), ("Disarm_Reason", 32, U32)]),
    "RxSdo": (0x04, 8, [("Opcode", 0, U8), ("Endpoint_ID", 8, U16), ("Reserved", 24, U8), ("Value", 32, U32)]),
    "TxSdo": (0x05, 8, [("Reserved0", 0, U8), ("Endpoint_ID", 8, U16), ("Reserved1", 24, U8), ("Value", 32, U32)]),
    "Set_Axis_State": (0x07, 8, [("Axis_Requested_State", 0, U32)]),
    "Get_Encoder_Estimates": (0x09, 8, [("Pos_Estimate", 0, F32), ("Vel_Estimate", 32, F32)]),
    "Set_Controller_Mode": (0x0B, 8, [("Control_Mode", 0, U32), ("Input_Mode", 32, U32)]),
    "Set_Input_Pos": (0x0C, 8, [("Input_Pos", 0, F32), ("Vel_FF", 32, I16), ("Torque_FF", 48, I16)]),
    "Set_Limits": (0x0F, 8, [("Velocity_Limit", 0, F32), ("Current_Limit", 32, F32)]),
    "Clear_Errors": (0x18, 1, [("Identify", 0, U8)]),
    "Set_Absolute_Position": (0x19, 8, [("Position", 0, F32)]),
}
"""Command, length in bytes, and signals (first bit, bits, order and sign) as the maker's protocol page gives them."""
SCALED = ("Vel_FF", "Torque_FF")


def dbc(node: int) -> Any:
    """The maker's messages of a node."""
    lines, floats = ['VERSION ""', "BU_: Master ODrive"], []
    for name, (command, length, signals) in MESSAGES.items():
        lines.append(f"BO_ {node << 5 | command} {name}: {length} ODrive")
        for signal, first, kind in signals:
            scale = "(0.001,0)" if signal in SCALED else "(1,0)"
            lines.append(f' SG_ {signal} : {first}|{kind} {scale} [0|0] "" Master')
            floats += [f"SIG_VALTYPE_ {node << 5 | command} {signal} : 1;"] if kind == F32 else []
        lines.append("")
    return cantools.database.load_string("\n".join([*lines, *floats, ""]), "dbc")


class Tapped(Desk):
    """A desk with a third node on its wire, which hears what is said from now on."""

    def __init__(self, table: OdriveTable) -> None:
        super().__init__(table)
        self._tap = SimulatedBus(self.medium, "tap")

    def spoken(self, name: str) -> list[dict[str, Any]]:
        """What has been on the wire of a message, decoded; what only asks for one has no data."""
        found = []
        while (message := self._tap.recv(0)) is not None:
            if message.arbitration_id == 2 << 5 | MESSAGES[name][0] and message.data:
                found.append(dbc(2).decode_message(name, bytes(message.data)))
        return found


@pytest.mark.parametrize("sign", [1, -1])
def test_a_position_and_its_rate(sign: int) -> None:
    desk = Tapped(OdriveTable(turns_per_m=100.0 * sign))
    desk.up()
    desk.ticks(20, ENABLE, 0.25)
    told = desk.spoken("Set_Input_Pos")[-1]
    assert told["Input_Pos"] == pytest.approx(sign * 100.0 * (desk.place - 0.25 * TICK), abs=0.06)
    assert (told["Vel_FF"], told["Torque_FF"]) == (pytest.approx(sign * 25.0), 0.0)


def test_states_results_and_errors() -> None:
    desk = Tapped(OdriveTable())
    desk.up()
    assert desk.spoken("Set_Axis_State")[0] == {"Axis_Requested_State": 8}
    desk.ticks(20, ENABLE, 0.1)
    beat = desk.spoken("Heartbeat")[-1]
    assert (beat["Axis_Error"], beat["Axis_State"], beat["Procedure_Result"]) == (0, 8, 0)
    desk.until_safe(QUICK_STOP)
    desk.ticks(10, OFF)
    assert desk.spoken("Set_Axis_State")[-1] == {"Axis_Requested_State": 1}
    desk.place = desk.drive.power.output
    desk.up()
    desk.until_safe(silent=True)
    desk.ticks(20, OFF)
    error = desk.spoken("Get_Error")[-1]
    assert error == {"Active_Errors": 0, "Disarm_Reason": 1 << 24}
    desk.reset()
    desk.ticks(2, OFF)
    assert desk.spoken("Clear_Errors") == [{"Identify": 0}]


def test_estimates_are_turns() -> None:
    desk = Tapped(OdriveTable(turns_per_m=-100.0))
    desk.up()
    desk.ticks(50, ENABLE, 0.1)
    told = desk.spoken("Get_Encoder_Estimates")[-1]
    assert told["Pos_Estimate"] == pytest.approx(-100.0 * desk.drive.power.output, abs=0.05)
    assert told["Vel_Estimate"] == pytest.approx(-10.0, rel=0.05)


def test_what_a_set_up_says(request: pytest.FixtureRequest) -> None:
    """Modes, limits, zero and questions for endpoints."""
    channel = request.node.name
    table = OdriveTable(home="here", enable_watchdog_endpoint=417, watchdog_timeout_endpoint=418)
    with closing(Running(channel, table)) as running, can.Bus(interface="virtual", channel=channel) as tap:
        assert isinstance(running.drive, OdriveDrive)
        with can.Bus(interface="virtual", channel=channel) as bus:
            set_up(bus, table, LIMITS, TICK)
        told: dict[int, bytes] = {}
        while (message := tap.recv(0)) is not None:
            if len(message.data):
                told.setdefault(message.arbitration_id & 0x1F, bytes(message.data))
    found = {
        name: dbc(2).decode_message(name, told[command], allow_truncated=name in ("RxSdo", "TxSdo"))
        for name, (command, _, _) in MESSAGES.items()
        if command in told
    }
    assert found["Set_Controller_Mode"] == {"Control_Mode": 3, "Input_Mode": 1}
    assert found["Set_Limits"] == {"Velocity_Limit": 25.0, "Current_Limit": 10.0}
    assert found["Set_Absolute_Position"] == {"Position": 0.0}
    assert (found["RxSdo"]["Opcode"], found["RxSdo"]["Endpoint_ID"]) == (0, 417)
    assert found["TxSdo"]["Endpoint_ID"] == 417
    assert (found["Get_Version"]["Fw_Version_Major"], found["Get_Version"]["Fw_Version_Minor"]) == (0, 6)
    assert struct.unpack("<BBBBBBBB", told[0])[4:7] == (0, 6, 11)
