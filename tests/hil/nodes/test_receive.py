"""What the controller node hears on the bus, and when it plausibility it."""

import math

import can
import numpy as np
import pytest

from hil.bus.protection import Sender
from hil.nodes.frame_map import ENABLED, FAULT, frame_map_of, frames
from hil.nodes.plausibility import Plausibility
from hil.nodes.receive import BY_OPERATOR, FrameReceiver
from hil.simulated.medium import Medium, SimulatedBus
from tests.hil.scripted_bus import ScriptedBus
from tests.hil.ticks import TICK


def test_ears_take_good_frames_and_their_age() -> None:
    medium = Medium()
    own, other = SimulatedBus(medium, "Controller"), SimulatedBus(medium, "Other")
    seen: list[can.Message] = []
    receiver = FrameReceiver(own, frame_map_of("magnetic"), TICK, seen.append)
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
    receiver = FrameReceiver(own, frame_map_of("magnetic"), TICK)
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
    plausibility = Plausibility(1e-3)
    for value in (0.1, 0.2, 0.2, 0.3, 0.3, 0.3):
        assert plausibility.reason(0) == ""
        plausibility.saw(value)
    assert plausibility.reason(0) == "localisation stuck"
    plausibility.saw(0.4)
    for k in range(5):
        assert plausibility.reason(0) == ""
        plausibility.tick(math.nan if k == 2 else 2e-3, [2e-3, 0.0])
        plausibility.tick(2e-3, [])
    assert plausibility.reason(0) == "drive does not follow"
    plausibility.tick(1e-3, [0.0])
    assert (plausibility.reason(0), plausibility.reason(1)) == ("", "localisation jumped")
    plausibility.settle(1)
    assert plausibility.reason(1) == ""
    for told in (0.0, 9e-5, 1.1e-4, 1.2e-4, 1.3e-4, 1.4e-4):
        plausibility.tick(told, [5e-7])
        assert plausibility.reason(1) == ""
    plausibility.tick(1.5e-4, [5e-7])
    assert plausibility.reason(1) == "drive does not follow"
    plausibility.tick(2.5e-4, [1e-7])
    assert plausibility.reason(1) == ""
    late = Plausibility(1e-3, lag_ticks=3)
    for k in range(50):
        late.tick(3e-3 * (k + 2), [3e-3 * k - 5e-4])
        assert late.reason(0) == "", "two ticks late, at any speed"
    for k in range(7):
        late.tick(0.0, [3.1e-3])
        assert late.reason(0) == ("" if k < 6 else "drive does not follow"), "two ticks late and five too many"
    coarse = Plausibility(1e-3, noise_m=0.0)
    for _ in range(9):
        coarse.saw(0.1)
    assert coarse.reason(0) == ""


@pytest.mark.parametrize(("resolution_m", "alike"), [(0.0, 3), (0.25e-3, 11), (1e-3, 44)])
def test_a_coarse_localiser_is_stuck_by_its_variance_over_time(resolution_m: float, alike: int) -> None:
    """Noise of 0.5 mm stays within pixels of that size so often in a row by chance once in 10^7."""
    rng = np.random.default_rng(3)
    plausibility = Plausibility(1e-3, 5e-4, resolution_m)
    for value in 5e-4 * rng.standard_normal(20_000):
        plausibility.saw(round(value / resolution_m) * resolution_m if resolution_m else value)
        assert plausibility.reason(0) == ""
    plausibility.saw(9.0)
    for k in range(1, alike + 1):
        assert plausibility.reason(0) == ""
        plausibility.saw(8.0)
        assert k < alike or plausibility.reason(0) == "localisation stuck"


def test_a_localiser_without_noise_is_stuck_by_motion() -> None:
    plausibility = Plausibility(1e-3, 0.0, 1e-3)
    for k in range(40):
        plausibility.wanted(5e-4 * k)
        plausibility.saw(0.0 if k < 15 else 7e-3)
        assert plausibility.reason(0) == ""
    plausibility.wanted(0.0201)
    assert plausibility.reason(0) == "localisation stuck"


def _message(name: str, data: bytes, **kind: bool) -> can.Message:
    told = {"is_extended_id": False, **kind}
    return can.Message(arbitration_id=frames()[name].id, data=data, **told)


@pytest.mark.parametrize(
    "error", [ValueError("x"), IndexError("y"), UnicodeDecodeError("ascii", b"\xff", 0, 1, "z"), can.CanError("c")]
)
def test_whatever_an_interface_raises_is_a_deaf_tick(error: Exception) -> None:
    feed = Sender(frames()["CarriageFeedback"])
    good = feed.frame({"Position_m": 0.05, "Velocity_m_s": 0, "State": ENABLED, "Temperature_degC": 30})
    receiver = FrameReceiver(ScriptedBus(error, _message("CarriageFeedback", good)), frame_map_of("magnetic"), TICK)
    assert receiver.listen(0.0) == []
    assert (receiver.deaf, receiver.deaf_words.split(":")[0]) == (1, type(error).__name__)
    assert len(receiver.listen(0.0)) == 1
    assert "1 times the bus could not be read" in receiver.refused_words


def test_what_is_refused_is_told_for_each_frame_and_reason() -> None:
    """A drive whose frames are too short is not silent."""
    feed = Sender(frames()["CarriageFeedback"])
    good = feed.frame({"Position_m": 0.05, "Velocity_m_s": 0, "State": ENABLED, "Temperature_degC": 30})
    bus = ScriptedBus(
        *(_message("CarriageFeedback", good[:1]) for _ in range(3)),
        _message("CarriageFeedback", good[:-1] + b"\xff"),
        _message("CarriageFeedback", good),
        _message("CarriageFeedback", good),
        _message("CarriageFeedback", good, is_fd=True),
        _message("CarriageFeedback", good, is_extended_id=True),
    )
    receiver = FrameReceiver(bus, frame_map_of("magnetic"), TICK)
    receiver.listen(0.0)
    assert receiver.refused == {"CarriageFeedback": {"length": 3, "crc": 1, "repeated": 1}}
    assert receiver.refused_words == (
        "5 CarriageFeedback refused (crc 1, length 3, repeated 1), 2 frames of other types (FD 1, extended 1): wrong"
        " length: its sender does not use capsule.dbc"
    )


def test_an_operators_safe_stop_is_no_other_controller() -> None:
    """Whatever its counter: two in a row may have the same one."""
    stop = Sender(frames()["SafeStop"]).frame({"Target": 0, "Reason": BY_OPERATOR})
    receiver = FrameReceiver(ScriptedBus(*[_message("SafeStop", stop)] * 2), frame_map_of("magnetic"), TICK)
    receiver.listen(0.5)
    assert (receiver.stopped_at, receiver.other_controller, receiver.rejected) == (0.5, "", 0)
    damaged = _message("SafeStop", bytes([stop[0] ^ 1]) + stop[1:])
    receiver = FrameReceiver(ScriptedBus(damaged), frame_map_of("magnetic"), TICK)
    receiver.listen(0.5)
    assert (receiver.stopped_at, receiver.foreign) == (-math.inf, {"SafeStop": 1})


@pytest.mark.parametrize("name", ["Sync", "CoilCommand", "ControllerHeartbeat", "SafeStop"])
def test_a_controllers_own_frames_from_elsewhere_are_another_controller(name: str) -> None:
    receiver = FrameReceiver(ScriptedBus(_message(name, bytes(8))), frame_map_of("magnetic"), TICK)
    assert receiver.other_controller == ""
    receiver.listen(0.5)
    assert (receiver.foreign, receiver.foreign_at) == ({name: 1}, 0.5)
    assert receiver.other_controller == f"another controller is on the bus ({name})"
    assert receiver.rejected == 1
