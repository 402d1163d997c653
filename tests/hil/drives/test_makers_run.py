"""`capsule run` leads another maker's drive in real time, is told of a fault that an earlier run left, and does not
lead beside another master.
"""

import json
import threading
import time
from pathlib import Path

import can
import pytest

from hil.app.main import run
from hil.bus.local import LocalBus
from hil.drives.cia402_protocol import Cia402Table
from hil.drives.makers import MAKERS
from hil.drives.moteus_protocol import BROADCAST, HOST, POSITION_MODE, QUERY, STOPPED, MoteusTable, frame_to, mode_write
from hil.drives.odrive_protocol import OdriveTable
from hil.drives.table import ActuatorTable
from hil.nodes.frame_map import ENABLE, FAULT, OFF, STANDBY
from hil.nodes.receive import FrameReceiver
from tests.hil.app.run.deployments import deployment, rig_file
from tests.hil.app.run.plant_process import REAL_TIME, RUN_S, led
from tests.hil.drives.maker_desk import LIMITS, WIRING, Desk
from tests.hil.scripted_bus import ScriptedBus
from tests.hil.ticks import TICK

TABLES = {
    "odrive": ("[odrive]\nenable_watchdog_endpoint = 417\nwatchdog_timeout_endpoint = 418\nanswers_s = 5.0\n", ""),
    "moteus": ("[moteus]\nanswers_s = 5.0\n", "fd = true"),
}


@pytest.mark.slow
@pytest.mark.parametrize("maker", TABLES)
def test_it_is_led_in_real_time(maker: str, tmp_path: Path, channel: str) -> None:
    """Two processes: set up, led through its states, at rest at the end, and replayed bit by bit."""
    table, bus = TABLES[maker]
    rig = rig_file(tmp_path, deployment(channel, control=REAL_TIME, more=table, bus=bus))
    log = tmp_path / "run.blf"
    found, truth, status = led(tmp_path, channel, rig, log, table, bus)
    assert (found["ended"], status) == ("done", 0)
    assert found["refused"] == found["unsent"] == 0
    assert truth["moved_m"] == pytest.approx(2e-3 * RUN_S, abs=RUN_S * 1e-3)
    assert (truth["state"], truth["fault"]) == (STANDBY, 0)
    assert run(["replay", str(log)]) == 0


@pytest.mark.parametrize("table", [OdriveTable(), MoteusTable()], ids=TABLES)
def test_a_controller_that_begins_anew_is_told_of_the_fault(table: ActuatorTable) -> None:
    desk = Desk(table)
    desk.up()
    desk.until_safe(silent=True)
    desk.bus = MAKERS[table.where].bus(desk.bus.inner, table, TICK)
    desk.heard = FrameReceiver(desk.bus, WIRING, TICK)
    desk.ticks(30, OFF)
    assert (desk.heard.state, desk.heard.fault) == (FAULT, 4)
    desk.reset()
    desk.ticks(30, ENABLE)
    assert (desk.heard.state, desk.heard.fault, desk.bus.trouble) == (STANDBY, 0, "")


def classic(identifier: int, data: bytes = b"") -> can.Message:
    return can.Message(arbitration_id=identifier, is_extended_id=False, data=data)


def reply_of(data: bytes) -> can.Message:
    """A reply of moteus node 1 to this controller."""
    return can.Message(arbitration_id=1 << 8 | HOST, is_extended_id=False, is_fd=True, data=data)


ORDERS = {
    "odrive": (
        OdriveTable(),
        [classic(2 << 5 | c, bytes(8)) for c in (0x02, 0x07, 0x0B, 0x0C, 0x0D, 0x0E, 0x18, 0x19)],
    ),
    "odrive endpoint": (OdriveTable(), [classic(2 << 5 | 0x04, b"\1\xa1\1\0\0")]),
    "moteus": (MoteusTable(), [frame_to(1, mode_write(STOPPED)), frame_to(BROADCAST, mode_write(POSITION_MODE))]),
    "moteus configuration": (MoteusTable(), [frame_to(1, b"\x40\1\4conf")]),
    "moteus of another host": (
        MoteusTable(),
        [can.Message(arbitration_id=1, is_extended_id=False, is_fd=True, data=mode_write(STOPPED))],
    ),
    "cia402": (Cia402Table(), [classic(0x201, bytes(6)), classic(0x6A0), classic(0x77F, b"\5")]),
    "cia402 network": (Cia402Table(), [classic(0, b"\x81\0"), classic(0, b"\2\1")]),
    "cia402 objects": (Cia402Table(), [classic(0x601, b"\x2b\x40\x60\0\x0f\0\0\0")]),
}
"""What another master says to a drive."""
QUESTIONS = {
    "odrive": (OdriveTable(), [classic(0x43), classic(0x44, b"\0\xa1\1\0"), classic(0x67, bytes(4)), classic(0x49)]),
    "moteus": (MoteusTable(), [frame_to(1, QUERY), frame_to(1, b"\x42\1\x30"), frame_to(2, mode_write(STOPPED))]),
    "cia402": (Cia402Table(), [classic(0x601, b"\x40\x41\x60\0\0\0\0\0"), classic(0, b"\x81\2"), classic(0x202)]),
}
"""What asks a drive alone, or is another drive's."""


def heard(table: ActuatorTable, messages: list[can.Message]) -> FrameReceiver:
    """A controller's ear on a wire with these frames."""
    bus = MAKERS[table.where].bus(ScriptedBus(*messages), table, TICK)
    receiver = FrameReceiver(bus, WIRING, TICK)
    receiver.listen(0.0)
    return receiver


@pytest.mark.parametrize("case", ORDERS)
def test_another_master_of_the_drive_is_another_controller(case: str) -> None:
    table, messages = ORDERS[case]
    assert heard(table, messages).foreign == {"CarriageCommand": len(messages)}


@pytest.mark.parametrize("case", QUESTIONS)
def test_who_only_asks_the_drive_is_none(case: str) -> None:
    table, messages = QUESTIONS[case]
    assert not heard(table, messages).foreign


@pytest.mark.parametrize("case", ORDERS)
def test_it_is_not_led_beside_another_master(
    case: str, tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Heard before anything is sent, so `run` and `reset` send nothing; `check` says BAD."""
    messages = ORDERS[case][1]
    name = case.split()[0]
    rig = rig_file(tmp_path, deployment(channel, more=f"[{name}]\n", bus="fd = true" if name == "moteus" else ""))
    over, sent = threading.Event(), list[int]()

    def speak() -> None:
        with LocalBus(channel, fd=True) as other:
            while not over.wait(5e-3):
                for message in messages:
                    other.send(message)
                while (message := other.recv(0)) is not None:
                    sent.append(message.arbitration_id)

    speaker = threading.Thread(target=speak)
    speaker.start()
    try:
        time.sleep(0.05)
        for words in ([], ["reset"]):
            assert run(["run", rig, *words, "--log", str(tmp_path / "run.blf"), "--json"]) == 1
            found = json.loads(capsys.readouterr().out)
            assert (found["end"], found["led"]) == ("other_controller", False)
            assert found["ended"] == "nothing to lead: another controller is on the bus (commands to the drive)"
        assert run(["run", rig, "check", "--json"]) == 1
        points = {point["what"]: point for point in json.loads(capsys.readouterr().out)["points"]}
        assert "another controller is on the bus (CarriageCommand)" in points["bus"]["words"]
    finally:
        over.set()
        speaker.join()
    assert sent == []


SHORT = {
    "odrive": (OdriveTable(), [classic(0x49, b"\1"), classic(0x49), classic(0x41, bytes(4)), classic(0x43, b"\1")]),
    "cia402": (
        Cia402Table(),
        [classic(0x181, b"\1"), classic(0x281, bytes(7)), classic(0x701), classic(0x701, bytes(8))],
    ),
    "moteus": (MoteusTable(), [reply_of(b""), reply_of(b"\x2f"), reply_of(b"\x2f\0\1\2\3"), reply_of(bytes(64))]),
}
"""What is shorter, or another length, than what a drive says."""


@pytest.mark.parametrize("case", SHORT)
def test_frames_of_the_drive_that_are_too_short_are_told_as_such(case: str) -> None:
    receiver = heard(*SHORT[case])
    counts = [count for reasons in receiver.refused.values() for count in reasons.items()]
    assert {reason for reason, _ in counts} == {"length"}
    assert sum(count for _, count in counts) == 4
    assert "CarriageFeedback refused (length" in receiver.refused_words


@pytest.mark.parametrize("table", [OdriveTable(answers_s=0.1), MoteusTable(answers_s=0.1), Cia402Table(answers_s=0.1)])
def test_an_interface_that_raises_as_the_drive_is_set_up_is_one_sentence(
    table: ActuatorTable, monkeypatch: pytest.MonkeyPatch
) -> None:
    def garbled(*_: object, **__: object) -> None:
        raise IndexError("a line of the interface is garbled")

    if isinstance(table, Cia402Table):
        pytest.importorskip("canopen", reason="needs the package canopen (extra canopen)")
    with can.Bus(interface="virtual", channel="garbled") as bus:
        monkeypatch.setattr(bus, "send", garbled)
        with pytest.raises(ValueError, match=r"node \d must .*; got: a line of the interface is garbled"):
            MAKERS[table.where].set_up(bus, table, LIMITS, TICK)
