"""A CiA 402 drive is looked at before it is set up, and is believed to have homed only where it shows that it has."""

from collections.abc import Callable
from contextlib import closing
from typing import Any

import can
import pytest

from hil.drives.cia402_protocol import DISABLED, FAULTED, OPERATION, Cia402Table
from hil.drives.cia402_setup import set_up
from tests.hil.drives.cia402_ends import LIMITS, TABLE, Polled
from tests.hil.ticks import TICK

HOMED = 2
"""The double's own number for a homing that is done."""
HOMING = TABLE.but(homing_method=17, homing_speed_m_s=0.1, homing_s=1.0)


def setting_up(
    channel: str, table: Cia402Table, change: Callable[[Any], object], *, faulty: bool = False, moving: bool = True
) -> Any:
    """The drive, `change`d before it was set up; where `moving` its power stage runs."""
    with closing(Polled(channel, table)) as polled, can.Bus(interface="virtual", channel=channel) as bus:
        change(polled.drive)
        if moving:
            listen = polled.drive.listen
            polled.drive.listen = lambda now, slots: (listen(now, slots), polled.drive.output(1e-3, 0.0))
        set_up(bus, table, LIMITS, TICK, faulty=faulty)
        return polled.drive


def faulted(drive: Any) -> None:
    drive.broken, drive.state = True, FAULTED
    drive.error = 0x7300


def enabled(drive: Any) -> None:
    drive.node.set_data(0x6060, 0, b"\x08")
    drive.node.sdo[0x6040].raw, drive.state = 0x0F, OPERATION


def knows(modes: int) -> Callable[[Any], None]:
    def change(drive: Any) -> None:
        drive.node.sdo[0x6502].raw = modes

    return change


def far(drive: Any) -> None:
    drive.zero_m = 3.0


def turning(drive: Any) -> None:
    """Not led, at a speed that its place shows, too."""
    drive.power.rate = 0.2
    drive.output = lambda dt, _: setattr(drive.power, "output", drive.power.output + 0.2 * dt)


def stays_in(mode: int) -> Callable[[Any], None]:
    def change(drive: Any) -> None:
        drive.mode, drive.stays = mode, True
        drive.node.set_data(0x6061, 0, mode.to_bytes(1, "little", signed=True))

    return change


@pytest.mark.parametrize(
    ("table", "change", "sentence"),
    [
        (TABLE, far, r"must stand within limits\.travel_m, 1 m of its zero; got -3 m: home it"),
        (TABLE, turning, r"must rest before the run; its speed is 0\.[1-4]"),
        (
            TABLE,
            faulted,
            r"must have no fault before the run; got error code 0x7300; 'capsule run RIG.toml reset'",
        ),
        (
            TABLE,
            enabled,
            r"must be disabled before the run; got operation, enabled by another master \(status",
        ),
        (TABLE, knows(1 << 0 | 1 << 5), r"must know mode 8 \(cyclic .* it knows 1 \(profile position\), 6 \(homing\)"),
        (TABLE.but(mode="velocity"), knows(1 << 7), r"must know mode 9 \(cyclic synchronous velocity\)"),
        (HOMING, knows(1 << 7), r"must know mode 6 \(homing\); 0x6502 says that it knows 8 \(cyclic"),
        (TABLE, stays_in(1), r"must take mode 8 \(cyclic synchronous position\); 0x6061 shows 1 \(profile position\)"),
        (TABLE, stays_in(-3), r"must take mode 8 .*; 0x6061 shows -3 \(of the maker\)"),
    ],
    ids=["far", "turning", "fault", "enabled", "no csp", "no csv", "no homing", "stays", "maker's mode"],
)
def test_one_that_is_not_to_be_led(
    table: Cia402Table, change: Callable[[Any], None], sentence: str, request: pytest.FixtureRequest
) -> None:
    with pytest.raises(ValueError, match=rf"cia402: node 1 {sentence}") as found:
        setting_up(request.node.name, table, change)
    assert "\n" not in str(found.value)


def test_one_whose_fault_is_to_be_acknowledged_is_set_up_and_not_homed(request: pytest.FixtureRequest) -> None:
    drive = setting_up(request.node.name, HOMING, faulted, faulty=True)
    assert (drive.state, drive.power.output, drive.node.sdo[0x6061].raw) == (FAULTED, 0.0, 8)
    with pytest.raises(ValueError, match="must be disabled before the run"):
        setting_up(request.node.name, HOMING, enabled, faulty=True)


def left_over(drive: Any) -> None:
    """Homed before, and it does not begin again."""
    drive.homing = HOMED
    drive._home = lambda **_: None


def still_in_csp(drive: Any) -> None:
    """Bits 12 and 10 are set in its statusword while it stays in CSP."""
    stays_in(8)(drive)
    drive._statusword = lambda: 0x1637 if drive.state == OPERATION else 0x1650


def homeless(drive: Any) -> None:
    drive.homeless = True


def slips(drive: Any) -> None:
    """It leaves homing mode once it is enabled."""
    home = drive._home

    def leave(**told: bool) -> None:
        home(**told)
        drive.homing = HOMED
        drive.mode = 8
        drive.node.sdo[0x6061].raw = 8

    drive._home = leave


def not_there(drive: Any) -> None:
    """Attained, and not yet at rest at its home: bit 12 without bit 10."""
    word = drive._statusword
    drive._statusword = lambda: word() & ~0x400


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (left_over, r"must be home within 1 s; statusword 0x1.*; bit 12 is from before it was started"),
        (still_in_csp, r"must take mode 6 \(homing\); 0x6061 shows 8 \(cyclic synchronous position\)"),
        (homeless, r"must home; got a homing error \(bit 13 of statusword 0x2"),
        (slips, r"must take mode 6 \(homing\); 0x6061 shows 8"),
        (not_there, r"must be home within 1 s; statusword 0x10"),
    ],
)
def test_a_homing_that_was_none(change: Callable[[Any], None], sentence: str, request: pytest.FixtureRequest) -> None:
    """Refused with the reason, and the drive ends at rest and not enabled."""
    with closing(Polled(request.node.name, HOMING)) as polled:
        change(polled.drive)
        listen = polled.drive.listen
        polled.drive.listen = lambda now, slots: (listen(now, slots), polled.drive.output(1e-3, 0.0))
        with (
            can.Bus(interface="virtual", channel=request.node.name) as bus,
            pytest.raises(ValueError, match=rf"cia402: node 1 {sentence}"),
        ):
            set_up(bus, HOMING, LIMITS, TICK)
    assert (polled.drive.state, polled.drive.power.at_rest) == (DISABLED, True)


@pytest.mark.parametrize(("method", "place"), [(17, 0.05), (35, 0.03), (37, 0.03)])
def test_one_that_has_homed_before_homes_again(method: int, place: float, request: pytest.FixtureRequest) -> None:
    """Bit 12 of the last time stands at the begin; method 35 is done before anybody could see it away."""

    def before(drive: Any) -> None:
        drive.homing, drive.power.output, drive.home_m = HOMED, 0.03, 0.05

    drive = setting_up(request.node.name, HOMING.but(homing_method=method), before)
    assert drive.zero_m == pytest.approx(place, abs=2e-3)
    assert (drive.state, drive.node.sdo[0x6061].raw) == (DISABLED, 8)
