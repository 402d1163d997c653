"""The bus between processes: everything arrives once and in order, nodes come and go, a node that sleeps harms itself
alone.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import can
import pytest

from hil.bus.local import LocalBus, channel_folder

BURST = 20_000
ECHO = """
import sys, can
from hil.bus.local import LocalBus
bus = LocalBus(sys.argv[1])
print("ready", flush=True)
while True:
    message = bus.recv(10)
    if message is None:
        break
    bus.send(can.Message(arbitration_id=message.arbitration_id + 1, is_extended_id=False, data=message.data))
"""


def message(number: int, identifier: int = 0x100) -> can.Message:
    return can.Message(arbitration_id=identifier, is_extended_id=False, data=number.to_bytes(8, "little"))


def echo(channel: str) -> subprocess.Popen[str]:
    child = subprocess.Popen([sys.executable, "-c", ECHO, channel], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    assert child.stdout.readline() == "ready\n"
    return child


def end(child: subprocess.Popen[str]) -> None:
    child.kill()
    child.communicate()


def test_every_frame_arrives_once_in_order_at_all_others(channel: str) -> None:
    with LocalBus(channel) as a, LocalBus(channel) as b, LocalBus(channel, receive_own_messages=True) as c:
        for k in range(100):
            c.send(message(k))
        for bus in (a, b, c):
            got = [bus.recv(0.1) for _ in range(100)]
            assert [int.from_bytes(m.data, "little") for m in got if m is not None] == list(range(100))
            assert bus.recv(0) is None
        assert a.overruns == b.overruns == c.overruns == 0


def test_a_burst_to_a_reader_in_another_process_loses_nothing(channel: str) -> None:
    with LocalBus(channel) as bus:
        child = echo(channel)
        back = []
        for start in range(0, BURST, 100):
            for k in range(start, start + 100):
                bus.send(message(k))
            while len(back) < start + 100:
                got = bus.recv(5)
                assert got is not None
                back.append(int.from_bytes(got.data, "little"))
        assert back == list(range(BURST))
        assert bus.overruns == 0
        end(child)


def test_a_killed_node_is_forgotten_and_another_one_can_join(channel: str) -> None:
    with LocalBus(channel) as bus:
        for _ in range(2):
            child = echo(channel)
            bus.send(message(7))
            got = bus.recv(5)
            assert got is not None
            assert got.arbitration_id == 0x101
            end(child)
            for k in range(500):
                bus.send(message(k))
        assert not bus._peers
    assert [place.name for place in channel_folder(channel).iterdir() if place.name != "lock"] != []
    with LocalBus(channel):
        assert len([place for place in channel_folder(channel).iterdir() if place.name != "lock"]) == 1


def test_a_frozen_node_loses_its_own_frames_alone(channel: str) -> None:
    with LocalBus(channel) as bus, LocalBus(channel) as other:
        child = echo(channel)
        os.kill(child.pid, signal.SIGSTOP)
        began = time.monotonic()
        seen = 0
        for k in range(3000):
            bus.send(message(k))
            seen += other.recv(0) is not None
        assert time.monotonic() - began < 2.0
        assert seen == 3000
        assert bus.overruns > 0
        end(child)


def test_python_can_finds_the_interface_by_name(channel: str) -> None:
    if "capsule_local" not in can.VALID_INTERFACES:
        pytest.skip("needs the project installed with its entry points: pip install -e .")
    with can.Bus(interface="capsule_local", channel=channel) as a, LocalBus(channel) as b:
        a.send(message(1))
        assert b.recv(0.1) is not None


def test_what_the_bus_does_not_carry_is_refused(channel: str, tmp_path: Path) -> None:
    with LocalBus(channel) as bus:
        for bad in (
            can.Message(arbitration_id=1),
            can.Message(arbitration_id=1, is_extended_id=False, is_remote_frame=True),
        ):
            with pytest.raises(ValueError, match="classic data frame"):
                bus.send(bad)
        with pytest.raises(NotImplementedError, match="one by one"):
            bus.send_periodic(message(1), 0.1)
        bus.shutdown()
        bus.shutdown()
    with pytest.raises(can.CanInitializationError, match="at most"):
        LocalBus("x" * 200)
    (tmp_path / "file").touch()
    with pytest.raises(can.CanInitializationError):
        LocalBus(str(tmp_path / "file" / "bus"))


def test_fd_frames_arrive_whole(short_path: Path) -> None:
    """64 bytes, 29 bits and the bit-rate switch; a node that was not opened for them sends none."""
    sent = can.Message(arbitration_id=0x8001, is_fd=True, bitrate_switch=True, data=bytes(range(64)))
    with LocalBus(str(short_path), fd=True) as near, LocalBus(str(short_path)) as far:
        near.send(sent)
        got = far.recv(1.0)
        assert got is not None
        assert got.equals(sent, timestamp_delta=None, check_direction=False, check_channel=False)
        with pytest.raises(ValueError, match="classic data frame"):
            far.send(sent)
