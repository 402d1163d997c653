"""The simulated CiA 402 drive is led and understood by another program: canopen's own profile 402."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import can
import pytest

from hil.drives.cia402_setup import entries, set_up
from tests.hil.drives.cia402_ends import LIMITS, TABLE, Polled
from tests.hil.ticks import TICK

canopen = pytest.importorskip("canopen", reason="needs the package canopen (extra canopen)")
p402 = pytest.importorskip("canopen.profiles.p402", reason="needs the package canopen (extra canopen)")
HOMING = TABLE.but(homing_method=17, homing_speed_m_s=0.1)


class Master:
    """canopen's node 402 on a wire with a drive, whose power stage runs, too."""

    def __init__(self, channel: str, bus: can.BusABC) -> None:
        self.polled = Polled(channel, HOMING)
        listen = self.polled.drive.listen
        self.polled.drive.listen = lambda now, slots: (listen(now, slots), self.polled.drive.output(1e-3, 0.0))
        self.network = canopen.Network(bus)
        self.network.connect()
        self.peer: Any = p402.BaseNode402(1, self.polled.drive.node.object_dictionary)
        self.network.add_node(self.peer)

    def close(self) -> None:
        self.network.notifier.stop(1.0)
        self.polled.close()


@contextmanager
def master(channel: str) -> Iterator[Master]:
    with can.Bus(interface="virtual", channel=channel) as bus, closing(Master(channel, bus)) as found:
        yield found


def test_it_homes_and_is_enabled_by_another_program(request: pytest.FixtureRequest) -> None:
    """Modes known and shown, bits 13, 12 and 10 of a homing, and every state on the way."""
    with master(request.node.name) as found:
        drive, peer = found.polled.drive, found.peer
        drive.home_m = 0.02
        for entry in entries(HOMING, LIMITS, TICK, 10):
            if entry.index in (0x6098, 0x6099):
                peer.sdo.download(entry.index, entry.sub, entry.data)
        known = [mode for mode in p402.OperationMode.SUPPORTED if peer.is_op_mode_supported(mode)]
        assert [mode for mode in known if mode != "NO MODE"] == [
            "HOMING",
            "CYCLIC SYNCHRONOUS POSITION",
            "CYCLIC SYNCHRONOUS VELOCITY",
        ]
        assert not peer.is_homed()
        assert peer._homing_status() == "INTERRUPTED"
        assert peer.homing(timeout=5.0)
        assert (peer.op_mode, peer._homing_status(), peer.state) == ("HOMING", "TARGET REACHED", "OPERATION ENABLED")
        assert drive.zero_m == pytest.approx(0.02, abs=2e-3)
        peer.state = "SWITCH ON DISABLED"
        drive.homeless = True
        assert not peer.homing(timeout=5.0)
        assert peer._homing_status() == "ERROR VELOCITY IS ZERO"


def test_what_is_set_up_here_is_read_by_another_program(request: pytest.FixtureRequest) -> None:
    """Its PDOs as the drive tells them over SDO, and statusword and place in a TPDO on the wire."""
    channel = request.node.name
    with closing(Polled(channel, TABLE)) as polled:
        with can.Bus(interface="virtual", channel=channel) as bus:
            set_up(bus, TABLE, LIMITS, TICK)
        polled.drive.power.output = -0.125
        with can.Bus(interface="virtual", channel=channel) as bus:
            network = canopen.Network(bus)
            network.connect()
            try:
                peer = p402.BaseNode402(1, polled.drive.node.object_dictionary)
                network.add_node(peer)
                for pdo in (peer.rpdo[1], peer.tpdo[1], peer.tpdo[2]):
                    pdo.read()
                assert [v.index for v in peer.rpdo[1].map] == [0x6040, 0x607A]
                assert (peer.rpdo[1].cob_id, peer.rpdo[1].trans_type) == (0x201, 1)
                assert (peer.tpdo[1].cob_id, peer.tpdo[2].cob_id) == (0x181, 0x281)
                heard = []
                peer.tpdo[1].add_callback(lambda pdo: heard.append((pdo[0x6041].raw, pdo[0x6064].raw)))
                network.send_message(0x201, bytes(6))
                network.send_message(0x6A0, b"")
                assert peer.tpdo[1].wait_for_reception(2.0)
                word, counts = heard[-1]
                mask, value = p402.State402.SW_MASK["SWITCH ON DISABLED"]
                assert word & mask == value
                assert counts == -125_000
                assert peer.op_mode == "CYCLIC SYNCHRONOUS POSITION"
            finally:
                network.notifier.stop(1.0)
