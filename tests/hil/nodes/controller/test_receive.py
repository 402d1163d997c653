"""What the controller node hears on the bus, and when it doubts it."""

import math

import can
import pytest

from hil.bus.protection import Sender
from hil.bus.simulated import Medium, SimulatedBus
from hil.nodes.controller.plausibility import Plausibility
from hil.nodes.controller.receive import FrameReceiver
from hil.nodes.frame_map import ENABLED, FAULT, frame_map_of, frames
from tests.hil.ticks import TICK


def test_ears_take_good_frames_and_their_age() -> None:
    medium = Medium()
    own, other = SimulatedBus(medium, "Controller"), SimulatedBus(medium, "Other")
    seen: list[can.Message] = []
    receiver = FrameReceiver(own, frames(), frame_map_of("magnetic"), TICK, seen.append)
    place, feed = Sender(frames()["CapsuleLocalisation"]), Sender(frames()["CarriageFeedback"])

    def send(name: str, data: bytes) -> None:
        other.send(can.Message(arbitration_id=frames()[name].id, is_extended_id=False, data=data))

    assert receiver.evidence(0.0).localisation_s == math.inf
    send("CapsuleLocalisation", place.frame({"Position_m": 0.1, "Quality": 1, "Age_s": 0.008, "Valid": 1}))
    send(
        "CarriageFeedback",
        feed.frame({"Position_m": 0.05, "Velocity_m_s": 0, "State": ENABLED, "Temperature_degC": 30}),
    )
    other.send(can.Message(arbitration_id=0x7FF, is_extended_id=False, data=bytes(8)))
    medium.advance(0.01)
    found = {m.channel: m for m in receiver.listen(0.01)}
    assert found["position_m"].value == pytest.approx(0.1)
    assert found["position_m"].stamp_s == pytest.approx(-0.008, abs=4e-4)
    assert found["carriage_position_m"].stamp_s == pytest.approx(0.0)
    assert (receiver.state, receiver.temperature_C) == (ENABLED, 30.0)
    assert receiver.report == pytest.approx(0.05)
    assert (receiver.rejected, len(seen)) == (1, 3)
    send("CapsuleLocalisation", place.frame({"Position_m": 0.1, "Quality": 0, "Age_s": 0, "Valid": 0}))
    bad = bytearray(feed.frame({"Position_m": 0.06, "Velocity_m_s": 0, "State": FAULT, "Temperature_degC": 30}))
    bad[4] ^= 4
    send("CarriageFeedback", bytes(bad))
    medium.advance(0.02)
    assert receiver.listen(0.02) == []
    assert (receiver.state, receiver.rejected) == (ENABLED, 2)
    assert receiver.evidence(0.02).localisation_s == pytest.approx(0.028, abs=5e-4)


def test_error_frames_are_counted_and_only_a_heartbeat_says_that_a_drive_is_known() -> None:
    medium = Medium()
    own, other = SimulatedBus(medium, "Controller"), SimulatedBus(medium, "Other")
    receiver = FrameReceiver(own, frames(), frame_map_of("magnetic"), TICK)
    receiver.listen(0.0)
    assert (receiver.beating, receiver.errors) == (False, 0)
    beat = frames()["CarriageHeartbeat"]
    data = bytearray(Sender(beat).frame({field.name: 0 for field in beat.fields}))
    for first, known in ((data[0] ^ 0x5A, False), (data[0], True)):
        data[0] = first
        other.send(can.Message(arbitration_id=beat.id, is_extended_id=False, data=bytes(data)))
        medium.advance(0.01 if known else 0.005)
        receiver.listen(0.01)
        assert receiver.beating is known


def test_doubts() -> None:
    doubts = Plausibility(1e-3)
    for value in (0.1, 0.2, 0.2, 0.3, 0.3, 0.3):
        assert doubts.reason(0) == ""
        doubts.saw(value)
    assert doubts.reason(0) == "localisation stuck"
    doubts.saw(0.4)
    for k in range(5):
        assert doubts.reason(0) == ""
        doubts.reported(0.0, math.nan if k == 2 else 2e-3)
    assert doubts.reason(0) == "drive does not follow"
    doubts.reported(0.0, 1e-3)
    assert (doubts.reason(0), doubts.reason(1)) == ("", "localisation jumped")
    doubts.settle(1)
    assert doubts.reason(1) == ""
    for told in (0.0, 4e-5, 6e-5, 7e-5, 8e-5, 9e-5):
        doubts.reported(5e-7, told)
        assert doubts.reason(1) == ""
    doubts.reported(5e-7, 1e-4)
    assert doubts.reason(1) == "drive does not follow"
    doubts.reported(1e-7, 2e-4)
    assert doubts.reason(1) == ""
    coarse = Plausibility(1e-3, noisy=False)
    for _ in range(9):
        coarse.saw(0.1)
    assert coarse.reason(0) == ""
