"""A moteus controller is found and asked what it does without commands, and led through its adapter."""

import math
import struct
from collections.abc import Iterator
from contextlib import closing

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.app.scenario.deployment import parse_deployment
from hil.app.scenario.deployment_tables import BusTable
from hil.bus.wrapping import WrappingBus
from hil.drives import moteus_protocol as wire
from hil.drives.moteus_bus import MoteusBus
from hil.drives.moteus_protocol import MoteusTable
from hil.drives.moteus_setup import set_up
from hil.nodes.frame_map import (
    ENABLE,
    ENABLED,
    FAULT,
    OFF,
    OVER_TEMPERATURE,
    QUICK_STOP,
    STANDBY,
    TIME_TO_LIVE,
)
from hil.simulated.medium import SimulatedBus
from hil.simulated.moteus_drive import BOOT_S, MoteusDrive
from models.theta import Theta
from tests.hil.app.run.deployments import deployment
from tests.hil.drives.maker_desk import LIMITS, Desk, Running
from tests.hil.scripted_bus import ScriptedBus
from tests.hil.ticks import TICK

TABLE = MoteusTable(answers_s=0.5)


@pytest.fixture
def running(request: pytest.FixtureRequest) -> Iterator[Running]:
    with closing(Running(request.node.name, TABLE)) as found:
        yield found


def setting_up(request: pytest.FixtureRequest, table: MoteusTable = TABLE) -> list[str]:
    with can.Bus(interface="virtual", channel=request.node.name) as bus:
        return set_up(bus, table, LIMITS, TICK)


def test_one_that_is_as_it_must_be(running: Running, request: pytest.FixtureRequest) -> None:
    setting_up(request)
    assert isinstance(running.drive, MoteusDrive)
    assert running.drive.watchdog_s == pytest.approx(TABLE.watchdog_s)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ("free", "servo.timeout_mode must be one of 10, 12, 15; got 0"),
        ("none", r"watchdog of its own \(servo.default_timeout_s\); got nan"),
        ("patient", r"must have servo.default_timeout_s in \(0, 0.1\] s; got 0.5"),
        ("lost", r"must know its position at the output \(home state 2\); got relative only"),
        (
            "rotor",
            r"must know its position at the output \(home state 2\); got rotor, which is within one of its turns",
        ),
        ("blind", "must measure where it is; got position nan"),
        ("open", "servo.fixed_voltage_mode must be 0; got 1"),
        ("feedforward", r"without a limit of acceleration \(fault 47\): servo.bemf_feedforward must be 0"),
        ("slow", r"servo.max_velocity must be at least 25 turns/s"),
        ("far", r"must stand within limits.travel_m of its zero, 1 m; got -50"),
        ("moving", r"must rest before the run; got -0.2 m/s"),
        ("leading", "must be stopped before the run; got mode 10"),
        ("elsewhere", "node 1 must answer within 0.5 s; node 5 speaks"),
    ],
)
def test_one_that_is_not(wrong: str, sentence: str, running: Running, request: pytest.FixtureRequest) -> None:
    drive = running.drive
    assert isinstance(drive, MoteusDrive)
    configured = {
        "free": ("servo.timeout_mode", 0.0),
        "none": ("servo.default_timeout_s", math.nan),
        "patient": ("servo.default_timeout_s", 0.5),
        "open": ("servo.fixed_voltage_mode", 1.0),
        "feedforward": ("servo.bemf_feedforward", 1.0),
        "slow": ("servo.max_velocity", 20.0),
    }
    drive.settings.update([configured[wrong]] if wrong in configured else [])
    if wrong in ("lost", "rotor"):
        drive.home = 0 if wrong == "lost" else 1
    elif wrong == "far":
        drive.power.output = -50.0
    elif wrong == "moving":
        drive.power.rate = -0.2
    elif wrong == "blind":
        drive.broken = True
    elif wrong == "leading":
        drive.watchdog_s, drive.state = math.nan, 10
    elif wrong == "elsewhere":
        drive.node_id = 5
    with pytest.raises(ValueError, match=sentence) as found:
        setting_up(request)
    assert "\n" not in str(found.value)


@pytest.mark.parametrize(("limit", "coast"), [(50.0, 5.0), (499.0, 5.0), (-1.0, 5.0), (0.0, 0.1)])
def test_holding_position_by_a_weak_brake_is_refused(
    limit: float, coast: float, running: Running, request: pytest.FixtureRequest
) -> None:
    """servo.timeout_mode 10 brakes by servo.default_accel_limit: as shipped in 0.5 s where 50 ms are stated."""
    assert isinstance(running.drive, MoteusDrive)
    running.drive.settings |= {"servo.timeout_mode": 10.0, "servo.default_accel_limit": limit}
    least = f"nan or at least {100 * coast:g} turns/s2, .*or servo.timeout_mode 12; got {limit:g}"
    with pytest.raises(ValueError, match=least):
        setting_up(request, TABLE.but(coast_m_s2=coast))


@pytest.mark.parametrize(("limit", "coast"), [(500.0, 5.0), (math.nan, 5.0), (50.0, 0.5)])
def test_holding_position_by_a_strong_brake_or_as_stated_is_taken(
    limit: float, coast: float, running: Running, request: pytest.FixtureRequest
) -> None:
    assert isinstance(running.drive, MoteusDrive)
    running.drive.settings |= {"servo.timeout_mode": 10.0, "servo.default_accel_limit": limit}
    assert setting_up(request, TABLE.but(coast_m_s2=coast)) == []


def test_a_fault_stays_for_the_operator(running: Running, request: pytest.FixtureRequest) -> None:
    """Whatever else is wrong with its place: a reset must reach it."""
    assert isinstance(running.drive, MoteusDrive)
    running.drive.broken, running.drive.home = True, 0
    running.drive.state, running.drive.fault = 1, 35
    assert setting_up(request) == []
    assert (running.drive.state, running.drive.fault, running.drive.prefix) == (1, 35, 0)


def test_a_travel_in_which_its_place_begins_anew_is_refused(running: Running, request: pytest.FixtureRequest) -> None:
    assert isinstance(running.drive, MoteusDrive)
    running.drive.settings["servo.max_velocity"] = 1e6
    with pytest.raises(ValueError, match=r"must reach limits.travel_m within 32768 turns, .*; got 40000"):
        setting_up(request, TABLE.but(turns_per_m=-4e4))


def test_a_firmware_without_the_newer_settings_is_taken(running: Running, request: pytest.FixtureRequest) -> None:
    assert isinstance(running.drive, MoteusDrive)
    for name in ("default_accel_limit", "bemf_feedforward", "fixed_voltage_mode", "max_velocity"):
        del running.drive.settings[f"servo.{name}"]
    assert setting_up(request) == []


def test_it_has_a_session_of_its_own_until_it_boots(running: Running, request: pytest.FixtureRequest) -> None:
    """Found again in it by a controller that begins anew; where it takes none, that is told and it is led."""
    drive = running.drive
    assert isinstance(drive, MoteusDrive)
    assert (setting_up(request), drive.prefix) == ([], wire.SESSION)
    assert (setting_up(request), drive.prefix) == ([], wire.SESSION)
    drive.prefix, drive.takes_prefix = 0, False
    assert setting_up(request) == ["moteus: node 1 does not take can.prefix: after a reset it obeys late commands"]
    assert drive.prefix == 0


def test_here_makes_the_present_place_zero(running: Running, request: pytest.FixtureRequest) -> None:
    assert isinstance(running.drive, MoteusDrive)
    running.drive.home, running.drive.power.output = 0, 0.3
    setting_up(request, TABLE.but(home="here"))
    assert (running.drive.home, running.drive.power.output) == (2, 0.0)


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


@pytest.mark.parametrize("speed", [0.05, 0.25])
def test_no_limit_of_the_drive_acts_on_what_it_is_told(speed: float) -> None:
    """The shipped 50 turns/s2 are 0.5 m/s2 here: 60 mm behind at 0.25 m/s. A quick stop takes what 25 m/s2 take, and
    the two ticks until it is on its way.
    """
    desk = Desk(TABLE)
    assert isinstance(desk.drive, MoteusDrive)
    assert desk.drive.settings["servo.default_accel_limit"] == 50.0
    desk.drive.settings["servo.default_velocity_limit"] = 3.0
    desk.up()
    for _ in range(100):
        desk.ticks(1, ENABLE, speed)
        assert abs(desk.drive.power.output - desk.place) <= 2 * speed * TICK
    before = desk.drive.power.output
    assert desk.until_safe(QUICK_STOP) <= speed / 25.0 + 6 * TICK
    assert abs(desk.drive.power.output - before) <= speed**2 / 50.0 + 2 * speed * TICK


@pytest.mark.parametrize(
    ("mode", "limit", "coast"),
    [(10, math.nan, 5.0), (10, 500.0, 5.0), (10, 50.0, 0.5), (12, 50.0, 5.0), (15, 50.0, 5.0)],
)
def test_silence_ends_in_the_stated_time_by_each_timeout_mode(mode: int, limit: float, coast: float) -> None:
    """From full speed, and within the way that it takes to brake as stated."""
    table = TABLE.but(coast_m_s2=coast)
    desk = Desk(table)
    assert isinstance(desk.drive, MoteusDrive)
    desk.drive.settings |= {"servo.timeout_mode": float(mode), "servo.default_accel_limit": limit}
    desk.up()
    desk.ticks(50, ENABLE, 0.25)
    before = desk.drive.power.output
    assert desk.until_safe(silent=True) <= table.stops_s(0.25) + TICK
    assert desk.drive.power.output - before <= 0.25 * (table.watchdog_s + TICK) + 0.25**2 / (2 * coast)


def test_one_that_is_weaker_than_stated_needs_longer() -> None:
    """What set_up refuses: 50 turns/s2 to hold position take 0.5 s and some 65 mm from 0.25 m/s."""
    desk = Desk(TABLE)
    assert isinstance(desk.drive, MoteusDrive)
    desk.drive.settings["servo.timeout_mode"] = 10.0
    desk.up()
    desk.ticks(50, ENABLE, 0.25)
    before = desk.drive.power.output
    assert desk.until_safe(silent=True) > 0.5
    assert desk.drive.power.output - before > 0.06


class Spoiling(WrappingBus):
    """A gateway that shifts the place of every command by some turns."""

    def recv(self, timeout: float | None = None) -> can.Message | None:
        message = self.inner.recv(timeout)
        if message is not None and bytes(message.data[:4]) == b"\1\0\x0a\x0e":
            message.data[5:9] = struct.pack("<f", struct.unpack_from("<f", message.data, 5)[0] + 0.5)
        return message


def test_a_command_that_was_not_sent_is_the_last() -> None:
    desk = Desk(TABLE)
    desk.up()
    desk.ticks(20, ENABLE, 0.05)
    desk.drive.bus = Spoiling(desk.drive.bus, "gateway")
    desk.ticks(3, ENABLE, 0.05)
    assert desk.bus.trouble == "moteus node 1: it holds another command than it was sent"
    assert desk.until_safe(ENABLE) <= 0.1
    desk.ticks(100, ENABLE)
    assert (desk.drive.safe, desk.heard.state) == (True, STANDBY)


def in_session() -> Desk:
    """A desk whose drive is as `set_up` leaves it."""
    desk = Desk(TABLE, booted=False)
    assert isinstance(desk.drive, MoteusDrive)
    desk.drive.configure(8)
    desk.ticks(50, OFF)
    return desk


@pytest.mark.parametrize("boots_s", [0.004, 0.03])
def test_one_that_has_booted_anew_is_not_led_by_what_was_for_the_other(boots_s: float) -> None:
    """However fast it boots: it has its own can.prefix again, is found there, and led once it has been set up anew, for
    its place may be another one.
    """
    desk = in_session()
    assert isinstance(desk.drive, MoteusDrive)
    desk.up()
    assert desk.heard.state == ENABLED
    desk.ticks(20, ENABLE, 0.05)
    before = desk.drive.power.output
    desk.drive.boot(desk.now)
    desk.drive._began = desk.now + boots_s - BOOT_S
    desk.ticks(40, ENABLE, 0.05)
    assert (desk.drive.safe, desk.bus.trouble) == (True, "moteus node 1: silent")
    assert desk.drive.power.output == pytest.approx(before, abs=0.05 * TICK + 0.05**2 / 10)
    desk.ticks(40, ENABLE)
    assert desk.bus.trouble == "moteus node 1: it was silent, perhaps booted anew"
    desk.place = desk.drive.power.output
    desk.up()
    assert (desk.heard.state, desk.drive.safe) == (STANDBY, True)
    desk.drive.configure(8)
    desk.ticks(60, OFF)
    desk.up()
    assert desk.heard.state == ENABLED


def test_at_the_end_it_has_its_own_prefix_back() -> None:
    desk = in_session()
    assert isinstance(desk.drive, MoteusDrive)
    desk.up()
    assert desk.heard.state == ENABLED
    desk.ticks(50, OFF)
    assert desk.drive.prefix == wire.SESSION
    desk.bus.shutdown()
    assert isinstance(desk.bus.inner, SimulatedBus)
    desk.drive.bus = ScriptedBus(desk.bus.inner.waiting[-1].message)
    desk.drive.listen(desk.now, 2)
    assert desk.drive.prefix == 0


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
        bus = MoteusBus(can.Bus(interface="virtual", channel="moteus fuzz"), TABLE, TICK)
        far.send(can.Message(arbitration_id=1 << 8 | wire.HOST, is_extended_id=False, is_fd=True, data=data))
        while bus.recv(0) is not None:
            pass
        assert isinstance(bus.trouble, str)
        bus.shutdown()


def test_the_bus_must_be_opened_for_its_frames() -> None:
    with pytest.raises(ValueError, match=r"bus\.fd must be true with \[moteus\]"):
        parse_deployment(deployment(more="[moteus]\n"), Theta())
    text = deployment(more="[moteus]\n").replace("[bus]\n", "[bus]\nfd = true\n")
    assert isinstance(parse_deployment(text, Theta()).drive, MoteusTable)
    with pytest.raises(ValueError, match="must name one drive"):
        parse_deployment(f"{text}\n[odrive]\n", Theta())


@pytest.mark.parametrize(("key", "value"), [("data_bitrate", 4_500_001), ("sample_point", 0.3)])
def test_bit_timing_that_no_clock_makes_is_refused(key: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"bus\.{key} must"):
        BusTable(interface="socketcan", fd=True, **{key: value})  # type: ignore[arg-type]
