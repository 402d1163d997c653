"""capsule_fd.dbc is capsule.dbc in CAN FD: tools read from it what goes over an authenticated bus."""

import can
import cantools
from cantools.database import Database

from hil.bus.authenticated import LENGTH, AuthenticatedBus
from hil.bus.catalogue import DBC, load_catalogue
from hil.bus.protection import Sender
from tests.bench.bench_forgery import KEY, Wire
from tests.hil.bus.fd_catalogue import FD_DBC, fd_dbc


def test_the_file_is_the_one_that_is_generated() -> None:
    """`python -m tests.hil.bus.fd_catalogue` writes it anew."""
    assert FD_DBC.read_text(encoding="utf-8") == fd_dbc(DBC.read_text(encoding="utf-8"))


def test_tools_decode_what_an_authenticated_bus_sends() -> None:
    classic, fd = cantools.database.load_file(DBC), cantools.database.load_file(FD_DBC)
    assert isinstance(classic, Database)
    assert isinstance(fd, Database)
    assert {m.name for m in fd.messages} == {m.name for m in classic.messages}
    assert all(m.is_fd and m.length == LENGTH for m in fd.messages)
    wire, frame = Wire(), load_catalogue()["CarriageCommand"]
    values = {"Position_m": 0.01, "Velocity_m_s": 0.002, "TimeToLive_ms": 18.0, "Mode": 2.0}
    data = Sender(frame).frame(values)
    AuthenticatedBus(wire, KEY, 77).send(can.Message(arbitration_id=frame.id, is_extended_id=False, data=data))
    sent = bytes(wire.sent[0].data)
    found = fd.decode_message(frame.id, sent, decode_choices=False)
    own = classic.decode_message(frame.id, data, decode_choices=False)
    assert {name: found[name] for name in own} == own
    assert (found["Count"], found["Epoch"]) == (1, 77)
    assert found["Authenticator"] == int.from_bytes(sent[16:], "little")
