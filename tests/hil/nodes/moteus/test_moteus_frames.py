"""moteus frames are those of the maker's own package, and what it encodes as a reply is read."""

from __future__ import annotations

import math
from typing import Any

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.nodes.moteus import registers as wire

peer: Any = pytest.importorskip("moteus", reason="needs the maker's package moteus")
SINGLE = st.floats(-1e6, 1e6, width=32)


def theirs(node: int) -> Any:
    """The maker's controller, which asks what we ask."""
    asked = peer.QueryResolution()
    for name in vars(peer.QueryResolution):
        if not name.startswith("_"):
            setattr(asked, name, peer.IGNORE)
    asked.mode = asked.position = asked.velocity = asked.fault = peer.F32
    asked._extra = {wire.WATCHDOG_TIMEOUT: peer.F32}
    return peer.Controller(id=node, query_resolution=asked, transport=object())


@given(SINGLE, SINGLE, SINGLE, st.floats(0.0, 0.5, width=32), st.integers(1, 126))
def test_a_command_is_the_packages(place: float, rate: float, torque: float, watchdog: float, node: int) -> None:
    found = wire.frame_to(node, wire.command(place, rate, torque, watchdog))
    expected = theirs(node).make_position(
        position=place, velocity=rate, maximum_torque=torque, watchdog_timeout=watchdog, query=True
    )
    assert bytes(found.data).rstrip(b"\x50") == bytes(expected.data).rstrip(b"\x50")
    assert found.arbitration_id == wire.REPLY_WANTED | wire.HOST << 8 | expected.destination
    assert (found.is_fd, found.bitrate_switch, len(found.data)) == (True, True, 32)


def test_stop_query_and_diagnostics_are_the_packages() -> None:
    controller = theirs(1)
    assert wire.mode_write(wire.STOPPED) == bytes(controller.make_stop(query=False).data)
    assert bytes(controller.make_query().data) == wire.QUERY
    line = b"conf get servo.timeout_mode\n"
    assert bytes((wire.STREAM_TO_SERVO, 1, len(line))) + line == bytes(controller.make_diagnostic_write(line).data)
    assert bytes((wire.STREAM_POLL, 1, 48)) == bytes(controller.make_diagnostic_read(48).data)


def test_replies_are_read() -> None:
    """The example of the maker's page, in int16 and int8; and one of ours with floats."""
    found = wire.told(bytes.fromhex("2404000a005000000170ff230d181400"))
    assert found == {0: 10, 1: 80, 2: 256, 3: -144, 13: 24, 14: 20, 15: 0}
    assert wire.told(bytes.fromhex("2e01") + bytes(8) + b"\x50\x50") == {1: 0.0, 2: 0.0}
    assert wire.told(bytes.fromhex("2d27cdcccc3d"))[wire.WATCHDOG_TIMEOUT] == pytest.approx(0.1)


@given(st.binary(max_size=64))
def test_nothing_that_comes_raises(data: bytes) -> None:
    assert all(isinstance(value, float) or math.isnan(value) for value in wire.told(data).values())


def test_only_fd_frames_to_this_controller_are_replies() -> None:
    reply = can.Message(arbitration_id=1 << 8 | wire.HOST, is_extended_id=False, is_fd=True)
    assert wire.replier(reply) == 1
    assert wire.replier(can.Message(arbitration_id=1 << 8 | wire.HOST, is_extended_id=False)) == -1
    assert wire.replier(can.Message(arbitration_id=0x100, is_extended_id=False, is_fd=True)) == -1
