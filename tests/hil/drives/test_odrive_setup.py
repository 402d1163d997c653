"""An ODrive is found, and its watchdog read back, before anything may move."""

import time
from collections.abc import Callable, Iterator
from contextlib import closing

import can
import pytest

from hil.app.scenario.deployment import parse_deployment
from hil.drives.moteus_protocol import MoteusTable
from hil.drives.odrive_protocol import AXIS_STATES, READ_BACK, OdriveTable
from hil.drives.odrive_setup import set_up
from hil.simulated import odrive_drive as simulated
from hil.simulated.odrive_drive import OdriveDrive
from models.theta import Theta
from tests.hil.app.run.deployments import deployment
from tests.hil.drives.maker_desk import LIMITS, Running
from tests.hil.ticks import TICK

TABLE = OdriveTable(enable_watchdog_endpoint=417, watchdog_timeout_endpoint=418, answers_s=0.5)


@pytest.fixture
def running(request: pytest.FixtureRequest) -> Iterator[Running]:
    with closing(Running(request.node.name, TABLE)) as found:
        yield found


def setting_up(request: pytest.FixtureRequest, table: OdriveTable = TABLE) -> None:
    with can.Bus(interface="virtual", channel=request.node.name) as bus:
        set_up(bus, table, LIMITS, TICK)


def test_one_that_is_as_it_must_be(running: Running, request: pytest.FixtureRequest) -> None:
    setting_up(request)
    assert running.drive.stage.fault == 0


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ("off", r"watchdog must be on \(axis0.config.enable_watchdog = True\); it is off"),
        ("long", "watchdog must expire within 0.02 s .*got 0.5"),
        ("leading", "must be idle before the run; got closed loop control"),
        ("slow", r"must send its encoder estimates every 4 ms \(can.encoder_msg_rate_ms\)"),
        ("elsewhere", "node 2 must answer within 0.5 s; node 5 speaks"),
    ],
)
def test_one_that_is_not(
    wrong: str, sentence: str, running: Running, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive = running.drive
    assert isinstance(drive, OdriveDrive)
    if wrong == "off":
        drive.watchdog_on = False
    elif wrong == "long":
        drive.watchdog_s = 0.5
    elif wrong == "leading":
        drive.watchdog_s = 0.019
        monkeypatch.setattr(drive, "state", 8)
        monkeypatch.setattr(drive, "_judge", lambda: None)
    elif wrong == "slow":
        monkeypatch.setattr(simulated, "ESTIMATES_EVERY", 20)
    else:
        drive.node_id = 5
    with pytest.raises(ValueError, match=sentence) as found:
        setting_up(request)
    assert "\n" not in str(found.value)


def doing(axis: int) -> Callable[[OdriveDrive], None]:
    def change(drive: OdriveDrive) -> None:
        drive.state = axis

    return change


def turning(drive: OdriveDrive) -> None:
    drive.power.rate = 0.2


def drifting(drive: OdriveDrive) -> None:
    """Its speed is told as 0, its place goes on."""
    drive.misread = lambda place: place + 0.02 * drive._now


def lost(drive: OdriveDrive) -> None:
    drive.broken = True
    drive._judge = lambda: None  # type: ignore[method-assign]


def far(drive: OdriveDrive) -> None:
    drive.power.output = 50.0


def hot(drive: OdriveDrive) -> None:
    drive.heated_to_C = LIMITS.temperature_C + 1


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        *(
            (doing(axis), f"must be idle before the run; got {words}")
            for axis, words in AXIS_STATES.items()
            if axis > 1
        ),
        (doing(99), "must be idle before the run; got axis state 99"),
        (hot, "must have no active error before the run; got INVERTER_OVER_TEMP; .*'capsule run RIG.toml reset'"),
        (turning, r"must rest before the run; its encoder shows 0\.2 m/s \(20 turns/s\)"),
        (drifting, r"must rest before the run; its encoder shows 0\.0"),
        (lost, "must know its position and speed before the run; its encoder estimates are nan"),
        (far, "must stand within limits.travel_m, 1 m of its zero; got 50 m"),
    ],
)
def test_one_that_does_not_rest_at_a_place_it_knows(
    change: Callable[[OdriveDrive], None], sentence: str, running: Running, request: pytest.FixtureRequest
) -> None:
    drive = running.drive
    assert isinstance(drive, OdriveDrive)
    drive.watchdog_s = 0.019
    time.sleep(0.1)
    change(drive)
    if drive.state == 8:
        drive._judge = lambda: None  # type: ignore[method-assign]
    with pytest.raises(ValueError, match=f"odrive: node 2 {sentence}") as found:
        setting_up(request)
    assert "\n" not in str(found.value)


def test_one_whose_error_is_to_be_acknowledged_is_set_up(running: Running, request: pytest.FixtureRequest) -> None:
    assert isinstance(running.drive, OdriveDrive)
    hot(running.drive)
    with can.Bus(interface="virtual", channel=request.node.name) as bus:
        set_up(bus, TABLE, LIMITS, TICK, faulty=True)


ENDPOINTS = tuple((path, 500 + k) for k, path in enumerate(READ_BACK))


@pytest.mark.parametrize(
    ("deaf", "sentence"),
    [
        (0x0B, r"must hold 3 at axis0\.controller\.config\.control_mode; it holds 2"),
        (0x0F, r"must hold 25 at axis0\.controller\.config\.vel_limit; it holds 10"),
        (0x19, r"must take its position as zero \(Set_Absolute_Position\); its encoder shows 0\.3 m"),
    ],
)
def test_what_it_does_not_take_is_told(deaf: int, sentence: str, request: pytest.FixtureRequest) -> None:
    table = TABLE.but(home="here", endpoints=ENDPOINTS)
    with closing(Running(request.node.name, table)) as found:
        drive = found.drive
        assert isinstance(drive, OdriveDrive)
        drive.power.output, drive.modes = 0.3, (2, 1)
        setting_up(request, table)
        assert (drive.modes, drive.vel_limit, drive.current_A, drive.zero_m) == ((3, 1), 25.0, 10.0, 0.3)
        drive.zero_m, drive.modes, drive.vel_limit = 0.0, (2, 1), 10.0
        drive.deaf_to = frozenset({deaf})
        with pytest.raises(ValueError, match=sentence):
            setting_up(request, table)


def test_what_became_of_its_last_procedure_is_told(running: Running, request: pytest.FixtureRequest) -> None:
    assert isinstance(running.drive, OdriveDrive)
    running.drive.result = 14
    with can.Bus(interface="virtual", channel=request.node.name) as bus:
        told = set_up(bus, TABLE, LIMITS, TICK)
        assert told[0] == "odrive: node 2's last procedure ended with NOT_CALIBRATED"
        running.drive.result = 1
        with pytest.raises(ValueError, match=r"must be idle .* got a procedure that goes on \(Procedure_Result BUSY\)"):
            set_up(bus, TABLE, LIMITS, TICK)


def test_what_is_not_read_back_is_told(running: Running, request: pytest.FixtureRequest) -> None:
    with can.Bus(interface="virtual", channel=request.node.name) as bus:
        (sentence,) = set_up(bus, TABLE, LIMITS, TICK)
    assert sentence.startswith("odrive: node 2 is not asked for axis0.controller.config.control_mode, ")
    assert sentence.endswith("[odrive.endpoints] does not state their ids")


def test_endpoints_that_nobody_stated_or_of_another_firmware(running: Running, request: pytest.FixtureRequest) -> None:
    with pytest.raises(ValueError, match=r"watchdog must be read back .* before 0\.6 cannot be asked over CAN"):
        setting_up(request, TABLE.but(watchdog_timeout_endpoint=0))
    with pytest.raises(ValueError, match=r"must have the firmware 0\.6\.10 of odrive\.firmware.*got 0\.6\.11"):
        setting_up(request, TABLE.but(firmware="0.6.10"))


def test_the_table_of_endpoints() -> None:
    table = "[odrive]\n[odrive.endpoints]\n"
    found = parse_deployment(deployment(more=f'{table}"axis0.controller.config.vel_limit" = 388\n'), Theta()).drive
    assert isinstance(found, OdriveTable)
    assert found.endpoints == (("axis0.controller.config.vel_limit", 388),)
    for wrong, sentence in (
        ('"axis0.controller.config.vel_limi" = 388', "did you mean 'axis0.controller.config.vel_limit'"),
        ('"axis0.controller.config.vel_limit" = 0', r"must be an integer in \[1, 65535\]; got 0"),
    ):
        with pytest.raises(ValueError, match=rf"odrive\.endpoints.*{sentence}"):
            parse_deployment(deployment(more=f"{table}{wrong}\n"), Theta())
    with pytest.raises(ValueError, match=r"keys of \[cia402\] must be among .*; got 'endpoints'"):
        parse_deployment(deployment(more="[cia402]\n[cia402.endpoints]\n"), Theta())


def test_a_speed_that_its_commands_cannot_carry() -> None:
    """Vel_FF has 16 bits in thousandths of a turn a second: 131 turns/m at 0.25 m/s are 32.75 turns/s."""
    parse_deployment(deployment(more="[odrive]\nturns_per_m = -131.0\n"), Theta())
    sentence = r"turns_per_m times limits\.carriage_speed_m_s must be at most 32\.767 turns/s.*; got 33"
    with pytest.raises(ValueError, match=sentence):
        parse_deployment(deployment(more="[odrive]\nturns_per_m = -132.0\n"), Theta())
    with pytest.raises(ValueError, match=sentence.replace("33", "32.8")):
        parse_deployment(deployment(more="[odrive]\n[limits]\ncarriage_speed_m_s = 0.328\n"), Theta())


def test_the_node_that_every_drive_hears() -> None:
    with pytest.raises(ValueError, match=r"odrive\.node_id must be one of .*of the broadcast; got 63"):
        OdriveTable(node_id=63)


def test_silence_is_one_sentence(request: pytest.FixtureRequest) -> None:
    with pytest.raises(ValueError, match=r"node 2 must answer within 0\.1 s; silence: supply, wiring, bit rate"):
        setting_up(request, TABLE.but(answers_s=0.1))


@pytest.mark.parametrize(
    ("key", "value"), [("turns_per_m", 0.0), ("watchdog_s", 1.0), ("home", "there"), ("coast_m_s2", 0.0)]
)
def test_bad_tables(key: str, value: float | str) -> None:
    with pytest.raises(ValueError, match=rf"odrive\.{key} must"):
        OdriveTable(**{key: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("table", [OdriveTable, MoteusTable])
def test_turns_per_m_may_have_either_sign(table: type[OdriveTable] | type[MoteusTable]) -> None:
    assert table(turns_per_m=-100.0).turns_per_m == -100.0
    for value in (-0.5, 0.5, -2e5):
        with pytest.raises(ValueError, match=r"turns_per_m must lie in \[1, 100000\], with either sign; got"):
            table(turns_per_m=value)
