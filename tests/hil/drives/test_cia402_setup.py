"""A CiA 402 drive's table in a rig file, and its set-up over SDO."""

import sys
import time
from collections.abc import Iterator
from contextlib import closing

import can
import pytest

from hil.app.scenario.deployment import parse_deployment
from hil.drives.cia402_protocol import DISABLED, Cia402Table
from hil.drives.cia402_setup import set_up
from models.theta import Theta
from tests.hil.app.run.deployments import deployment
from tests.hil.drives.cia402_ends import LIMITS, TABLE, Polled
from tests.hil.ticks import TICK


@pytest.fixture
def polled(request: pytest.FixtureRequest) -> Iterator[Polled]:
    """A drive that answers."""
    with closing(Polled(request.node.name)) as found:
        yield found


def test_set_up_over_sdo(polled: Polled, request: pytest.FixtureRequest) -> None:
    """Everything is written, read back and taken: PDO maps, the deadline of commands, the reactions; and the drive
    stays disabled.
    """
    with can.Bus(interface="virtual", channel=request.node.name) as bus:
        set_up(bus, TABLE, LIMITS, TICK)
        time.sleep(0.1)
    polled.halt()
    node = polled.drive.node
    assert polled.drive.state == DISABLED
    assert [v.index for v in node.rpdo[1].map] == [0x6040, 0x607A]
    assert [v.index for v in node.tpdo[1].map] == [0x6041, 0x6064]
    assert (node.sdo[0x1400][5].raw, node.sdo[0x1016][1].raw) == (8, 127 << 16 | 60)
    assert (node.sdo[0x605A].raw, node.sdo[0x605E].raw, node.sdo[0x6007].raw) == (2, 2, 1)
    assert (node.sdo[0x607D][1].raw, node.sdo[0x607F].raw) == (-1_000_000, 250_000)


@pytest.mark.parametrize("missing", ["nobody", "canopen"])
def test_no_drive_or_no_package_is_one_sentence(
    missing: str, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    if missing == "canopen":
        monkeypatch.setitem(sys.modules, "canopen", None)
    else:
        pytest.importorskip("canopen", reason="needs the package canopen (extra canopen)")
    with (
        can.Bus(interface="virtual", channel=request.node.name) as bus,
        pytest.raises(ValueError, match="cia402") as found,
    ):
        set_up(bus, Cia402Table(answers_s=0.1), LIMITS, TICK)
    assert "\n" not in str(found.value)
    assert ("install the extra" if missing == "canopen" else "node 1 must answer") in str(found.value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("node_id = 16", "cia402.node_id must lie in"),
        ("counts_per_m = 0.0", "cia402.counts_per_m must lie in"),
        ("answers_s = -1.0", "cia402.answers_s must lie in"),
        ("nodeid = 1", "did you mean"),
    ],
)
def test_bad_tables(text: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        parse_deployment(deployment(more=f"[cia402]\n{text}\n"), Theta())


def test_only_a_carriage_speaks_it() -> None:
    text = deployment(more="[cia402]\n").replace('kind = "magnetic"', 'kind = "coil"')
    text = text.replace("magnet_stiffness_N_per_m = 25.0", "").replace(
        "magnet_range_m = 0.02", "force_constant_N_per_A = 0.5"
    )
    with pytest.raises(ValueError, match=r"cia402 must stand with rig\.kind magnetic"):
        parse_deployment(text, Theta())
