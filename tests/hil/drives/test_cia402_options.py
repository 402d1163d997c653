"""What a deployment may say of a CiA 402 drive: homing, its own objects, led by speeds; and what is rounded is told."""

from collections.abc import Callable
from contextlib import closing
from typing import Any

import can
import pytest

from hil.app.scenario.deployment import parse_deployment
from hil.drives.cia402_protocol import DISABLED, Cia402Table
from hil.drives.cia402_setup import set_up
from models.theta import Theta
from tests.hil.app.run.deployments import deployment
from tests.hil.app.sil.sil_runs import run
from tests.hil.drives.cia402_ends import LIMITS, TABLE, Polled
from tests.hil.ticks import TICK


def setting_up(
    channel: str, table: Cia402Table, change: Callable[[Any], object] = lambda _: None
) -> tuple[Any, list[str]]:
    """The drive once it has been set up by `table`, `change`d before; and what was told."""
    with closing(Polled(channel, table)) as polled, can.Bus(interface="virtual", channel=channel) as bus:
        change(polled.drive)
        told = set_up(bus, table, LIMITS, TICK)
        return polled.drive, told


def test_its_own_objects_are_written_and_read_back(request: pytest.FixtureRequest) -> None:
    drive, told = setting_up(request.node.name, TABLE.but(options=((0x2000, 0, 700),)))
    assert (int(drive.node.sdo[0x2000].raw), told) == (700, [])
    with pytest.raises(ValueError, match=r"cia402\.options: 0x2000:00 must fit into 2 bytes; got 70000"):
        setting_up(request.node.name, TABLE.but(options=((0x2000, 0, 70_000),)))


def test_a_rounded_readback_is_told_and_another_value_refused(request: pytest.FixtureRequest) -> None:
    def rounding(by: int, index: int) -> Callable[[Any], object]:
        def change(drive: Any) -> None:
            def held(**found: Any) -> bytes | None:
                if found["index"] != index:
                    return None
                data = bytes(drive.node.data_store[index][found["subindex"]])
                return (int.from_bytes(data, "little") + by).to_bytes(len(data), "little")

            drive.node.add_read_callback(held)

        return change

    _, told = setting_up(request.node.name, TABLE, rounding(-1, 0x607F))
    assert told == ["cia402: node 1 holds 249999 at 0x607F:00, rounded from 250000"]
    with pytest.raises(ValueError, match="must take 250000 at 0x607F:00; it holds"):
        setting_up(request.node.name, TABLE, rounding(-5000, 0x607F))
    with pytest.raises(ValueError, match="must take 2 at 0x605A:00; it holds"):
        setting_up(request.node.name, TABLE, rounding(1, 0x605A))


@pytest.mark.parametrize(("method", "place"), [(35, 0.03), (17, 0.05)])
def test_homing_by_its_method(method: int, place: float, request: pytest.FixtureRequest) -> None:
    """Method 35 takes the present place, 17 the switch to which it moves; it ends disabled, at rest, led by places."""

    def stand(drive: Any) -> None:
        drive.power.output, drive.home_m = 0.03, 0.05

    table = TABLE.but(homing_method=method, homing_speed_m_s=0.1, homing_s=5.0)
    with closing(Polled(request.node.name, table)) as polled:
        stand(polled.drive)
        moved = polled.drive.listen
        polled.drive.listen = lambda now, slots: (moved(now, slots), polled.drive.output(1e-3, 0.0))
        with can.Bus(interface="virtual", channel=request.node.name) as bus:
            set_up(bus, table, LIMITS, TICK)
    drive = polled.drive
    assert drive.zero_m == pytest.approx(place, abs=2e-3)
    assert (drive.state, drive.node.sdo[0x6060].raw, drive.power.at_rest) == (DISABLED, 8, True)


def test_homing_that_does_not_end_is_refused_and_stopped(request: pytest.FixtureRequest) -> None:
    table = TABLE.but(homing_method=17, homing_s=0.3)

    def far(drive: Any) -> None:
        drive.home_m = 0.9

    with pytest.raises(ValueError, match=r"node 1 must be home within 0\.3 s"):
        setting_up(request.node.name, table, far)


def test_led_by_speeds_it_ends_where_places_lead() -> None:
    by_place, by_speed = (run("magnetic", 0.6, cia402={"mode": mode})[0].rows[-1] for mode in ("position", "velocity"))
    assert by_speed[1] == pytest.approx(by_place[1], abs=2e-4)


def test_the_table_of_options() -> None:
    text = deployment(more='[cia402]\nmode = "velocity"\n[cia402.options]\n"6083.0" = 5000\n"3005.1f" = -1\n')
    found = parse_deployment(text, Theta()).drive
    assert isinstance(found, Cia402Table)
    assert found.options == ((0x6083, 0, 5000), (0x3005, 0x1F, -1))
    for wrong, sentence in (
        ('"6083" = 1', "must have keys as"),
        ('"6083.0" = 1.5', "must be an integer"),
        ('"0.0" = 1', "must have keys as"),
    ):
        with pytest.raises(ValueError, match=rf"cia402\.options .*{sentence}|{sentence}"):
            parse_deployment(deployment(more=f"[cia402.options]\n{wrong}\n"), Theta())
    with pytest.raises(ValueError, match=r"cia402\.mode must be one of position, velocity"):
        Cia402Table(mode="torque")
