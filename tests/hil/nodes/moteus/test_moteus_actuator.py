"""A moteus controller is found and asked what it does without commands, and led through its adapter."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.app.scenario.deployment import BusTable, parse_deployment
from hil.bus.catalogue import load_catalogue
from hil.nodes.drive.state_machine import OVER_TEMPERATURE, TIME_TO_LIVE
from hil.nodes.frame_map import ENABLE, ENABLED, FAULT, OFF, QUICK_STOP, READY, STANDBY, WAITING
from hil.nodes.moteus import registers as wire
from hil.nodes.moteus.actuator import MoteusBus, MoteusTable, set_up
from hil.nodes.moteus.drive import MoteusDrive
from tests.hil.app.run.deployments import deployment
from tests.hil.nodes.maker_desk import LIMITS, Desk, Running
from tests.hil.ticks import TICK

TABLE = MoteusTable(answers_s=0.5)


@pytest.fixture
def running(request: pytest.FixtureRequest) -> Iterator[Running]:
    with closing(Running(request.node.name, TABLE)) as found:
        yield found


def setting_up(request: pytest.FixtureRequest, table: MoteusTable = TABLE) -> None:
    with can.Bus(interface="virtual", channel=request.node.name) as bus:
        set_up(bus, table)


def test_one_that_is_as_it_must_be(running: Running, request: pytest.FixtureRequest) -> None:
    setting_up(request)
    assert isinstance(running.drive, MoteusDrive)
    assert running.drive.watchdog_s == pytest.approx(TABLE.watchdog_s)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ("free", "servo.timeout_mode must be one of 10, 12, 15; got 0"),
        ("none", r"watchdog of its own \(servo.default_timeout_s\); got nan"),
        ("lost", "must know its place .*got relative only"),
        ("leading", "must be stopped before it is led; got mode 10"),
        ("elsewhere", "node 1 must answer within 0.5 s; node 5 speaks"),
    ],
)
def test_one_that_is_not(wrong: str, sentence: str, running: Running, request: pytest.FixtureRequest) -> None:
    drive = running.drive
    assert isinstance(drive, MoteusDrive)
    if wrong == "free":
        drive.settings["servo.timeout_mode"] = 0.0
    elif wrong == "none":
        drive.settings["servo.default_timeout_s"] = float("nan")
    elif wrong == "lost":
        drive.home = 0
    elif wrong == "leading":
        drive.watchdog_s, drive.mode = float("nan"), 10
    else:
        drive.node_id = 5
    with pytest.raises(ValueError, match=sentence) as found:
        setting_up(request)
    assert "\n" not in str(found.value)


def test_here_makes_the_present_place_zero(running: Running, request: pytest.FixtureRequest) -> None:
    assert isinstance(running.drive, MoteusDrive)
    running.drive.home, running.drive.power.output = 0, 0.3
    setting_up(request, replace(TABLE, home="here"))
    assert (running.drive.home, running.drive.power.output) == (2, 0.0)


def test_it_is_led_and_stopped() -> None:
    desk = Desk(TABLE)
    desk.ticks(20, ENABLE)
    assert desk.heard.state == STANDBY
    desk.ticks(20, READY)
    assert desk.heard.state == WAITING
    desk.ticks(20, ENABLE)
    assert desk.heard.state == ENABLED
    desk.ticks(100, ENABLE, 0.1)
    assert desk.drive.power.output == pytest.approx(desk.place, abs=2 * 0.1 * TICK)
    assert desk.until_safe(QUICK_STOP) <= 0.1 / 25.0 + 6 * TICK
    desk.ticks(20, OFF)
    assert (desk.heard.state, desk.bus.trouble, desk.heard.fault) == (STANDBY, "", 0)


def test_silence_ends_by_the_watchdog_that_each_command_brings() -> None:
    """In the stated time from full speed; "off" does not clear it, an acknowledgement does."""
    desk = Desk(TABLE)
    desk.up()
    desk.ticks(50, ENABLE, 0.25)
    assert desk.until_safe(silent=True) <= TABLE.stops_s(0.25) + TICK
    desk.ticks(20, OFF)
    assert (desk.heard.state, desk.heard.fault) == (FAULT, TIME_TO_LIVE)
    assert desk.bus.trouble == "moteus node 1: watchdog expired (mode 11, timeout)"
    desk.reset()
    desk.ticks(20, ENABLE)
    assert (desk.heard.state, desk.drive.safe) == (STANDBY, True)
    desk.place = desk.drive.power.output
    desk.up()
    assert desk.heard.state == ENABLED


def test_a_fault_and_a_reboot_are_told_by_name() -> None:
    desk = Desk(TABLE)
    desk.up()
    desk.drive.boot(desk.now)
    desk.ticks(50, ENABLE)
    assert (desk.drive.safe, desk.bus.trouble) == (True, "moteus node 1: it was silent, perhaps booted anew")
    desk.up()
    assert desk.heard.state == ENABLED
    desk.drive.heated_to_C = LIMITS.temperature_C + 1
    desk.ticks(10, ENABLE)
    desk.drive.heated_to_C = 20.0
    desk.ticks(50, OFF)
    assert (desk.heard.state, desk.heard.fault) == (FAULT, OVER_TEMPERATURE)
    assert desk.bus.trouble == "moteus node 1: over temperature"


@given(st.binary(max_size=64))
def test_nothing_that_a_drive_says_raises(data: bytes) -> None:
    with can.Bus(interface="virtual", channel="moteus fuzz") as far:
        bus = MoteusBus(can.Bus(interface="virtual", channel="moteus fuzz"), TABLE, load_catalogue(), TICK)
        far.send(can.Message(arbitration_id=1 << 8 | wire.HOST, is_extended_id=False, is_fd=True, data=data))
        while bus.recv(0) is not None:
            pass
        assert isinstance(bus.trouble, str)
        bus.shutdown()


def test_the_bus_must_be_opened_for_its_frames() -> None:
    with pytest.raises(ValueError, match=r"bus\.fd must be true with \[moteus\]"):
        parse_deployment(deployment(more="[moteus]\n"), {})
    text = deployment(more="[moteus]\n").replace("[bus]\n", "[bus]\nfd = true\n")
    assert isinstance(parse_deployment(text, {}).drive, MoteusTable)
    with pytest.raises(ValueError, match="must name one drive"):
        parse_deployment(f"{text}\n[odrive]\n", {})


@pytest.mark.parametrize(("key", "value"), [("data_bitrate", 4_500_001), ("sample_point", 0.3)])
def test_bit_timing_that_no_clock_makes_is_refused(key: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"bus\.{key} must"):
        BusTable("socketcan", fd=True, **{key: value})  # type: ignore[arg-type]
