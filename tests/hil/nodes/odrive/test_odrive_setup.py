"""An ODrive is found, and its watchdog read back, before anything may move."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import can
import pytest

from hil.nodes.moteus.actuator import MoteusTable
from hil.nodes.odrive import drive as simulated
from hil.nodes.odrive.actuator import OdriveTable, set_up
from hil.nodes.odrive.drive import OdriveDrive
from tests.hil.nodes.maker_desk import LIMITS, Running
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
        ("leading", "must be idle before it is led; got closed loop control"),
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
        monkeypatch.setattr(drive, "axis", 8)
        monkeypatch.setattr(drive, "_judge", lambda: None)
    elif wrong == "slow":
        monkeypatch.setattr(simulated, "ESTIMATES_EVERY", 20)
    else:
        drive.node_id = 5
    with pytest.raises(ValueError, match=sentence) as found:
        setting_up(request)
    assert "\n" not in str(found.value)


def test_endpoints_that_nobody_stated_or_of_another_firmware(running: Running, request: pytest.FixtureRequest) -> None:
    with pytest.raises(ValueError, match=r"watchdog must be read back .* before 0\.6 cannot be asked over CAN"):
        setting_up(request, replace(TABLE, watchdog_timeout_endpoint=0))
    with pytest.raises(ValueError, match=r"must have the firmware 0\.6\.10 of odrive\.firmware.*got 0\.6\.11"):
        setting_up(request, replace(TABLE, firmware="0.6.10"))


def test_silence_is_one_sentence(request: pytest.FixtureRequest) -> None:
    with pytest.raises(ValueError, match=r"node 2 must answer within 0\.1 s; silence: supply, wiring, bit rate"):
        setting_up(request, replace(TABLE, answers_s=0.1))


@pytest.mark.parametrize(
    ("key", "value"), [("turns_per_m", 0.0), ("watchdog_s", 1.0), ("home", "there"), ("coast_m_s2", 0.0)]
)
def test_bad_tables(key: str, value: float | str) -> None:
    with pytest.raises(ValueError, match=rf"odrive\.{key} must"):
        OdriveTable(**{key: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("table", [OdriveTable, MoteusTable])
def test_turns_per_m_may_have_either_sign(table: type[OdriveTable] | type[MoteusTable]) -> None:
    assert table(turns_per_m=-100.0).turns_per_m == -100.0
    for value in (-0.5, 0.5, -2e5, float("nan")):
        with pytest.raises(ValueError, match=r"turns_per_m must lie in \[1, 100000\], with either sign; got"):
            table(turns_per_m=value)
