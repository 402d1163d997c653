"""moteus frames are those of the maker's own package, both ways: what the controller sends is what it makes and reads,
what it encodes as a reply is read, and the simulated drive takes its commands and answers what it can parse.
"""

import math
import struct
from contextlib import suppress
from typing import Any

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.limits import Limits
from hil.drives import moteus_protocol as wire
from hil.drives.moteus_protocol import FAULTS, READ, MoteusTable, Part
from hil.drives.moteus_setup import BRAKING_MODES
from hil.simulated import moteus_drive as simulated
from hil.simulated.moteus_drive import answer
from hil.simulated.power_stage import CarriagePower
from tests.hil.scripted_bus import ScriptedBus
from tests.hil.ticks import TICK

peer: Any = pytest.importorskip("moteus", reason="needs the maker's package moteus")
protocol: Any = pytest.importorskip("moteus.protocol")
Register = protocol.Register
SINGLE = st.floats(-1e6, 1e6, width=32)


def theirs(node: int) -> Any:
    """The maker's controller, which asks what we ask."""
    asked = peer.QueryResolution()
    for name in vars(peer.QueryResolution):
        if not name.startswith("_"):
            setattr(asked, name, peer.IGNORE)
    asked.mode = asked.position = asked.velocity = asked.fault = peer.F32
    asked._extra = dict.fromkeys(wire.HELD, peer.F32)
    return peer.Controller(id=node, query_resolution=asked, transport=object())


def trimmed(data: bytes | bytearray) -> bytes:
    """A frame without its padding."""
    return bytes(data).rstrip(b"\x50")


@given(SINGLE, SINGLE, SINGLE, st.floats(0.0, 0.5, width=32), st.integers(1, 126))
def test_a_command_is_the_packages(place: float, rate: float, torque: float, watchdog: float, node: int) -> None:
    """Without limits of speed and acceleration: negative ones."""
    found = wire.frame_to(node, wire.command(place, rate, torque, watchdog))
    expected = theirs(node).make_position(
        position=place,
        velocity=rate,
        maximum_torque=torque,
        watchdog_timeout=watchdog,
        velocity_limit=-1.0,
        accel_limit=-1.0,
        query=True,
    )
    assert trimmed(found.data) == trimmed(expected.data)
    wants_reply = 0x8000 if expected.reply_required else 0  # as the maker's transport has it
    assert found.arbitration_id == wants_reply | wire.HOST << 8 | expected.destination
    assert (found.is_fd, found.bitrate_switch, len(found.data)) == (True, True, 48)


def test_the_package_reads_a_command_as_it_is_meant() -> None:
    read = protocol.parse_registers(bytes(wire.frame_to(1, wire.command(1.5, -2.0, 0.5, 0.25)).data))
    assert read.command == {
        Register.MODE: peer.Mode.POSITION,
        Register.COMMAND_POSITION: 1.5,
        Register.COMMAND_VELOCITY: -2.0,
        Register.COMMAND_POSITION_MAX_TORQUE: 0.5,
        Register.COMMAND_TIMEOUT: 0.25,
        Register.COMMAND_VELOCITY_LIMIT: -1.0,
        Register.COMMAND_ACCEL_LIMIT: -1.0,
    }
    asked = [Register.MODE, Register.POSITION, Register.VELOCITY, Register.FAULT]
    assert [number for number, _ in read.query] == [*asked, *wire.HELD]
    assert not read.errors


def test_stop_query_and_diagnostics_are_the_packages() -> None:
    controller = theirs(1)
    assert wire.mode_write(wire.STOPPED) == bytes(controller.make_stop(query=False).data)
    assert bytes(controller.make_query().data) == wire.QUERY
    line = "conf get servo.timeout_mode"
    assert wire.stream(line) == bytes(controller.make_diagnostic_write(f"{line}\n".encode()).data)
    assert bytes((wire.STREAM_POLL, 1, 48)) == bytes(controller.make_diagnostic_read(48).data)
    zero = controller.make_set_output_exact(position=0.0, query=False)
    assert wire.write(wire.SET_OUTPUT_EXACT, (0.0,)) == bytes(zero.data)


def test_a_session_is_the_packages_prefix() -> None:
    """As the maker's transport makes the identifier of a command with a `can_prefix`."""
    command = peer.Controller(id=5, can_prefix=wire.SESSION, transport=object()).make_query()
    assert wire.frame_to(5, b"", wire.SESSION).arbitration_id >> 16 == command.can_prefix
    assert wire.frame_to(5, b"", wire.SESSION).arbitration_id & 0x7F == command.destination


@pytest.mark.parametrize("prefix", wire.PREFIXES)
def test_another_master_is_heard_in_a_session_too(prefix: int) -> None:
    assert MoteusTable().orders(wire.frame_to(1, wire.mode_write(wire.STOPPED), prefix))
    assert not MoteusTable().orders(wire.frame_to(1, wire.QUERY, prefix))
    assert not MoteusTable().orders(wire.frame_to(1, wire.mode_write(wire.STOPPED), 7))


def test_modes_and_registers_have_the_packages_numbers() -> None:
    modes = {wire.STOPPED: "STOPPED", wire.FAULTED: "FAULT", wire.POSITION_MODE: "POSITION", wire.TIMED_OUT: "TIMEOUT"}
    braking = dict(zip(BRAKING_MODES, ("POSITION", "ZERO_VELOCITY", "BRAKE"), strict=True))
    assert {number: peer.Mode(number).name for number in (modes | braking)} == modes | braking
    assert (wire.HOME_STATE, wire.SET_OUTPUT_EXACT) == (Register.HOME_STATE, Register.SET_OUTPUT_EXACT)
    assert (min(FAULTS), max(FAULTS)) == (32, 50)


def test_replies_are_read() -> None:
    """The example of the maker's page, in int16 and int8; one of ours with floats; and a register that is unknown."""
    found = wire.reported(bytes.fromhex("2404000a005000000170ff230d181400"))
    assert found == {0: 10, 1: 80, 2: 256, 3: -144, 13: 24, 14: 20, 15: 0}
    assert wire.reported(bytes.fromhex("2e01") + bytes(8) + b"\x50\x50") == {1: 0.0, 2: 0.0}
    assert wire.reported(bytes.fromhex("2d27cdcccc3d"))[wire.WATCHDOG_TIMEOUT] == pytest.approx(0.1)
    assert wire.reported(bytes.fromhex("302801312901") + bytes.fromhex("2100 0a")) == {0: 10}


def read_by_the_package(data: bytes) -> list[tuple[int, float]]:
    """Registers and raw values that the package finds in a reply, up to where it breaks off."""
    found: list[tuple[int, float]] = []
    with suppress(IndexError, RuntimeError, struct.error):
        found += ((part.register, part.value) for part in peer.multiplex.parse_frame(data) if hasattr(part, "value"))
    return found


@given(st.binary(max_size=64))
def test_what_comes_is_read_as_the_package_reads_it(data: bytes) -> None:
    """Nothing raises, and nothing is found that the package does not find."""
    theirs_too = [(number, value) for number, value in read_by_the_package(data) if value is not None]
    for number, value in wire.reported(data).items():
        assert any(number == n and (value == v or (math.isnan(value) and math.isnan(v))) for n, v in theirs_too)


@given(
    st.lists(
        st.one_of(
            st.tuples(st.sampled_from([0x01, 0x0D, 0x20, 0x27, 0x131]), st.just(wire.FLOAT), st.integers(1, 4)),
            st.tuples(st.just(0x0C), st.just(wire.INT8), st.integers(1, 4)),
        ),
        min_size=1,
        max_size=2,
    ),
    st.floats(-100.0, 100.0, width=32),
)
def test_replies_in_every_form_are_read_whole(asked: list[tuple[int, int, int]], value: float) -> None:
    """Of one to four registers, as floats or int8: what the package reads, all of it."""
    data = b"".join(answer(Part(READ, first, count, form), lambda _: value)[0] for first, form, count in asked)
    assert wire.reported(data) == dict(read_by_the_package(data))
    assert len(wire.reported(data)) == len({first + k for first, _, count in asked for k in range(count)})


def test_only_fd_frames_to_this_controller_are_replies() -> None:
    reply = can.Message(arbitration_id=1 << 8 | wire.HOST, is_extended_id=False, is_fd=True)
    assert wire.replier(reply) == 1
    session = wire.SESSION << 16 | 1 << 8 | wire.HOST
    assert wire.replier(can.Message(arbitration_id=session, is_extended_id=True, is_fd=True)) == 1
    assert wire.replier(can.Message(arbitration_id=session | 1 << 16, is_extended_id=True, is_fd=True)) == -1
    assert wire.replier(can.Message(arbitration_id=1 << 8 | wire.HOST, is_extended_id=False)) == -1
    assert wire.replier(can.Message(arbitration_id=0x100, is_extended_id=False, is_fd=True)) == -1


class Bench:
    """The simulated drive, spoken to by the maker's package alone."""

    def __init__(self) -> None:
        limits, table = Limits(), MoteusTable()
        self.drive = simulated.MoteusDrive(ScriptedBus(), table, CarriagePower(0.25, 1.0), limits, TICK)
        self.now = 0.1

    def ask(self, command: Any) -> dict[int, float]:
        """What the package parses of the drive's reply to one of its commands."""
        sent: list[can.Message] = []
        self.drive.bus = bus = ScriptedBus(wire.frame_to(command.destination, bytes(command.data)))
        bus.send = lambda message, timeout=None: sent.append(message)  # type: ignore[method-assign]
        self.now += 1e-3
        self.drive.listen(self.now, 2)
        self.drive.output(1e-3, 0.0)
        (reply,) = sent
        found: dict[int, float] = protocol.parse_message(reply).values
        assert protocol.parse_message(reply).id == command.destination
        return found


@pytest.mark.parametrize("resolution", [peer.INT8, peer.F32])
def test_the_simulated_drive_speaks_with_the_package(resolution: int) -> None:
    """It is led to 0.5 turns by the limits that the package writes, and replies in the package's units."""
    asked = peer.QueryResolution()
    asked.mode = peer.INT8
    asked.position = asked.velocity = peer.F32
    asked.voltage = asked.temperature = resolution
    asked.home_state = asked.fault = peer.INT8
    asked._extra = dict.fromkeys(wire.HELD, peer.F32)
    bench = Bench()
    controller = peer.Controller(1, query_resolution=asked, transport=object())
    for _ in range(150):
        found = bench.ask(
            controller.make_position(
                position=0.5, velocity=0.0, watchdog_timeout=0.1, velocity_limit=8.0, accel_limit=-1.0, query=True
            )
        )
    assert found[Register.MODE] == peer.Mode.POSITION
    assert found[Register.POSITION] == pytest.approx(0.5, abs=1e-6)
    assert found[Register.COMMAND_POSITION] == pytest.approx(0.5, abs=1e-6)
    assert found[Register.COMMAND_TIMEOUT] == pytest.approx(0.1, rel=1e-6)
    assert found[Register.COMMAND_VELOCITY_LIMIT] == pytest.approx(8.0, abs=1e-6)
    assert found[Register.COMMAND_ACCEL_LIMIT] == pytest.approx(-1.0, abs=1e-6)
    assert (found[Register.VOLTAGE], found[Register.TEMPERATURE]) == (24.0, 25.0)
    assert (found[Register.HOME_STATE], found[Register.FAULT]) == (2, 0)


def test_what_a_command_does_not_write_has_the_shipped_limit() -> None:
    """25 turns/s are reached in half a second, and then 6 turns late: 60 mm at 100 turns/m."""
    bench, controller = Bench(), peer.Controller(1, transport=object())
    for k in range(510):
        wanted = 25.0 * k * 1e-3
        found = bench.ask(controller.make_position(position=wanted, velocity=25.0, query=True))
    assert wanted - found[Register.POSITION] == pytest.approx(25.0**2 / (2 * 50.0), abs=0.4)
    assert found[Register.VELOCITY] == pytest.approx(25.0, abs=0.1)


def test_the_simulated_drive_refuses_what_it_does_not_know() -> None:
    """As register errors that the package reads; a mode that cannot be commanded changes nothing."""
    bench, controller = Bench(), peer.Controller(1, transport=object())
    sent: list[can.Message] = []
    for data in ("0d0e00000000", "2001", "1d7b", "010105", "010002", "33"):
        bench.drive.bus = bus = ScriptedBus(wire.frame_to(1, bytes.fromhex(data)))
        bus.send = lambda message, timeout=None: sent.append(message)  # type: ignore[method-assign]
        bench.drive.listen(bench.now, 2)
    errors = [protocol.parse_registers(bytes(message.data)).errors for message in sent]
    assert [number for found in errors for number, _ in found] == [Register.TEMPERATURE, 0x7B, Register.POSITION]
    assert bench.drive.rejected == 2, "a reply, and an error"
    assert bench.ask(controller.make_query())[Register.MODE] == peer.Mode.STOPPED
