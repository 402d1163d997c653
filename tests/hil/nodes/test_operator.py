"""Setpoints of an operator on a simulated bus: who is in charge, what is refused, and that letting go holds the capsule
in a tick and stops the drive in time. Every run's log replays bit by bit.
"""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest

from hil.app.run.loop import Outcome, StopSignals
from hil.bus.catalogue import load_catalogue
from hil.bus.protection import Sender
from hil.nodes.frame_map import ENABLED, MOVING, STANDBY, frame_map_of
from hil.nodes.operator import AHEAD_M, Operator, OperatorLimits
from hil.nodes.operator_sender import OperatorSender
from hil.nodes.receive import FrameReceiver
from hil.simulated.medium import SimulatedBus
from plant import layout as at
from tests.hil.app.run.test_run_ends import Rig, led
from tests.hil.scripted_bus import ScriptedBus

LIMITS = OperatorLimits(accept=True, stop_after_s=0.3, lowest_m=-0.02, highest_m=0.02)
STILL: Any = {"reference": {"kind": "hold", "position_mm": 0.0}}
Say = Callable[[OperatorSender, float], None]


class Hands:
    """Operators beside a run: each of `says` has a node of its own and speaks once in 20 ms, none at the same time: on
    a wire frames of one identifier from two nodes collide.
    """

    def __init__(self, *says: tuple[str, Say], limits: OperatorLimits = LIMITS) -> None:
        self.says, self.limits = says, limits
        self.senders: list[OperatorSender] = []
        self.wanted: list[tuple[float, float, int]] = []
        self.ticks, self.now = 0, 0.0

    def each(self, node: Rig, signals: StopSignals, now: float) -> None:
        self.now = now
        if not self.senders:
            self.senders = [
                OperatorSender(SimulatedBus(node.bench.medium, f"hand{k}"), name, clock=lambda: self.now)
                for k, (name, _) in enumerate(self.says)
            ]
        place = float(node._reference.position(np.array([now]))[0])
        self.wanted.append((now, place, node.receiver.state))
        for k, (sender, (_, say)) in enumerate(zip(self.senders, self.says, strict=True)):
            if self.ticks % 10 == 3 * k:
                say(sender, now)
                sender.listen()
        self.ticks += 1

    def run(self, folder: Path, seconds: float = 2.0, **more: Any) -> tuple[Outcome, Rig]:
        return led(folder, each=self.each, seconds=seconds, operator=self.limits, **{**STILL, **more})

    @property
    def paths(self) -> tuple[Any, Any, Any]:
        """Times, wanted positions and the drive's states."""
        t, x, state = map(np.array, zip(*self.wanted, strict=True))
        return t, x, state


def pressed(since: float, until: float, speed: float = 0.004) -> Say:
    return lambda hand, now: hand.speed(speed) if since <= now < until else hand.release()


def moved(node: Rig) -> float:
    rows = np.concatenate(node.bench.plant.session.rows)
    return float(rows[-1, at.O_X] - rows[0, at.O_X])


def test_released_means_held_then_stopped_and_pressed_again_goes_on(tmp_path: Path) -> None:
    """3 mm at 4 mm/s, held from the tick on in which the release has come, off 0.3 s later, then 2 mm back."""

    def say(hand: OperatorSender, now: float) -> None:
        if 0.8 <= now < 1.6:
            hand.speed(0.004)
        elif 2.4 <= now < 2.9:
            hand.speed(-0.004)
        else:
            hand.release()

    hands = Hands(("joystick", say))
    outcome, node = hands.run(tmp_path, 3.0)
    assert (outcome.end, outcome.led) == ("done", True)
    t, x, state = hands.paths
    start = x[(t > 0.5) & (t < 0.8)]
    assert np.ptp(start) == 0
    there = x[(t > 1.604) & (t < 2.3)]
    assert np.ptp(there) == 0, "held within a tick of the frame's arrival"
    assert there[0] - start[0] == pytest.approx(0.8 * 0.004, abs=2e-4)
    assert set(state[(t > 1.0) & (t < 1.88)]) == {ENABLED}
    assert set(state[(t > 2.0) & (t < 2.4)]) == {STANDBY}, "stopped 0.3 s after the release"
    assert set(state[(t > 2.6) & (t < 3.1)]) == {ENABLED}, "and enabled again by hand"
    assert x[(t > 3.0) & (t < 3.1)][0] - there[0] < -0.001
    assert node.operator is not None
    assert (node.operator.presses, node.operator.expired, dict(node.operator.refused)) == (2, 0, {})
    assert hands.senders[0].answer is not None
    assert hands.senders[0].answer.state in ("held", "stopped", "off")
    assert moved(node) == pytest.approx(x[t > 3.0][0] - start[0], abs=1e-3)


def test_a_sender_that_dies_is_held_after_its_setpoint_has_lived(tmp_path: Path) -> None:
    """100 ms after its last frame; it is in charge again only once it has been heard released."""
    last: list[float] = []

    def say(hand: OperatorSender, now: float) -> None:
        if now < 0.6:
            hand.release()
        elif now < 1.0 or 1.2 <= now < 1.5:
            hand.speed(0.004)
            if now < 1.0:
                last.append(now)

    hands = Hands(("script", say))
    _, node = hands.run(tmp_path)
    t, x, _ = hands.paths
    assert np.ptp(x[(t > last[-1] + 0.1 + 0.004)]) == 0
    assert np.all(np.diff(x[(t > 0.7) & (t < last[-1] + 0.1)]) > 0)
    assert node.operator is not None
    assert (node.operator.presses, node.operator.expired) == (1, 1)
    assert node.operator.refused["not_released"] > 5
    assert not node.enabled


def test_one_at_a_time(tmp_path: Path) -> None:
    """Who presses while another holds is refused and told so, and must release first; another name is not taken."""
    told: set[str] = set()

    def second(hand: OperatorSender, now: float) -> None:
        pressed(0.8, 1.4, -0.004)(hand, now)
        if hand.answer is not None:
            told.add(f"{hand.answer.refused} {hand.answer.source}")

    limits = OperatorLimits(accept=True, stop_after_s=0.3, sources=("joystick", "cockpit"))
    hands = Hands(
        ("joystick", pressed(0.6, 1.2)), ("cockpit", second), ("ros", pressed(0.0, 9.0, -0.004)), limits=limits
    )
    _, node = hands.run(tmp_path)
    t, x, _ = hands.paths
    assert np.all(np.diff(x[t > 0.5]) >= 0)
    assert np.ptp(x[t > 1.204]) == 0, "the second one has not released in between"
    assert node.operator is not None
    assert node.operator.presses == 1
    assert set(node.operator.refused) == {"busy", "not_released", "source"}
    assert node.receiver.refused["OperatorSetpoint"]["busy"] >= 15
    assert {"busy joystick", "source joystick"} & told


def test_never_past_the_limits_of_the_deployment(tmp_path: Path) -> None:
    """A setpoint of 0.4 m/s is 5 mm/s, one of a metre the highest position, and speed changes by 50 mm/s2."""

    def say(hand: OperatorSender, now: float) -> None:
        hand.release() if now < 0.6 else hand.speed(0.4) if now < 1.5 else hand.position(1.0, 0.4)

    limits = OperatorLimits(accept=True, highest_m=0.006)
    hands = Hands(("ros", say), limits=limits)
    hands.run(tmp_path, 2.5)
    t, x, _ = hands.paths
    speed = np.diff(x[t > 0.62]) / np.diff(t[t > 0.62])
    assert np.max(speed) == pytest.approx(limits.speed_m_s, rel=1e-6)
    assert np.max(np.abs(np.diff(speed))) <= limits.acceleration_m_s2 * 2e-3 + 1e-6
    assert np.max(x) == pytest.approx(limits.highest_m, abs=1e-9)


def test_not_asked_for_it_is_not_listened_to(tmp_path: Path) -> None:
    def each(node: Rig, signals: StopSignals, now: float) -> None:
        hands.each(node, signals, now)

    hands = Hands(("ros", pressed(0.6, 2.0)))
    _, node = led(tmp_path, each=each, **STILL)
    assert node.operator is None
    t, x, _ = hands.paths
    assert np.ptp(x[t > 0.5]) == 0
    assert hands.senders[0].answer is None
    assert node.receiver.reception.unknown[0x230] > 20


def frames_of(*values: dict[str, float]) -> list[bytes]:
    sender = Sender(load_catalogue()["OperatorSetpoint"])
    common = {"Position_m": 0.0, "Velocity_m_s": 0.004, "TimeToLive_ms": 100, "Mode": 1, "DeadMan": 1, "Source": 3}
    return [sender.frame(common | one) for one in values]


def heard(frames: Iterable[bytes], delay_s: float = 0.0) -> Operator:
    operator = Operator(LIMITS)
    for k, data in enumerate(frames):
        operator.accept(data, 0.02 * k, 0.02 * k + delay_s)
    return operator


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda good: good[:7], "length"),
        (lambda good: bytes([good[0] ^ 1]) + good[1:], "crc"),
        (lambda good: good[:4] + bytes([good[4] ^ 0x80]) + good[5:], "crc"),
        (lambda good: frames_of({"DeadMan": 0.0}, *(5 * [{}]), {})[6], "counter"),
        (lambda good: frames_of({"DeadMan": 0.0})[0], "repeated"),
        (lambda good: bytes(8), "crc"),
    ],
)
def test_a_bad_frame_changes_nothing_and_is_counted(spoil: Callable[[bytes], bytes], reason: str) -> None:
    released, good = frames_of({"DeadMan": 0.0}, {})
    operator = heard([released, spoil(good)])
    assert dict(operator.refused) == {reason: 1}
    assert (operator.source, operator.taken) == (0, False)
    assert heard([released, good]).source == 3


def test_a_setpoint_that_is_read_late_is_not_followed() -> None:
    operator = heard(frames_of({"DeadMan": 0.0}, {}, {}), 0.101)
    assert dict(operator.refused) == {"late": 2}
    assert operator.source == 0


def sent(arrives: Callable[[int], float], count: int, limits: OperatorLimits = LIMITS) -> tuple[Operator, list[float]]:
    """Released, then held, `count` setpoints in all, the k-th of which comes at `arrives(k)` in s; and when those came
    at which somebody was in charge.
    """
    operator, led = Operator(limits), []
    for k, data in enumerate(frames_of({"DeadMan": 0.0}, *((count - 1) * [{}]))):
        now = arrives(k)
        operator.expire(now)
        operator.accept(data, now, now)
        if operator.source:
            led.append(now)
    return operator, led


@pytest.mark.parametrize("longer_s", [0.002, 0.005, 0.02, 0.06])
def test_what_a_gateway_holds_back_ever_longer_is_late_once_it_is_older_than_it_lives(longer_s: float) -> None:
    """Each setpoint later by `longer_s` than the one before. The last one that leads is at most as old as it lives and
    2 % of the time since the first; the reference is held when it has lived.
    """
    operator, led = sent(lambda k: (0.02 + longer_s) * k, 400)
    sent_at = 0.02 * round(led[-1] / (0.02 + longer_s))
    assert led[-1] - sent_at <= 0.1 + 0.02 * led[-1]
    assert operator.source == 0
    assert operator.expired == 1
    assert set(operator.refused) <= {"late", "not_released"}
    assert operator.refused["late"] > 200


def test_it_leads_again_after_a_release_once_the_way_is_free() -> None:
    operator, _ = sent(lambda k: 0.03 * k, 60)
    assert operator.source == 0
    sender = Sender(load_catalogue()["OperatorSetpoint"])
    common = {"Position_m": 0.0, "Velocity_m_s": 0.004, "TimeToLive_ms": 100, "Mode": 1, "Source": 3}
    for k in range(200):
        operator.accept(sender.frame(common | {"DeadMan": float(k > 100)}), 10.0 + 0.02 * k, 10.0 + 0.02 * k)
    assert operator.source == 3


@pytest.mark.parametrize("share", [0.0, 0.012, 0.019])
def test_a_sender_whose_clock_is_slower_is_followed(share: float) -> None:
    """As one that sleeps for 20 ms between setpoints: 30 s, and now and then 15 ms late."""
    operator, led = sent(lambda k: 0.02 * (1 + share) * k + 0.015 * (k % 150 == 149), 1500)
    assert len(led) == 1499
    assert not operator.refused


def test_a_slow_sender_is_followed_where_the_deployment_says_so() -> None:
    """30 setpoints a second."""
    operator, _ = sent(lambda k: k / 30, 300)
    assert operator.source == 0
    operator, led = sent(lambda k: k / 30, 300, LIMITS.but(drift_share=0.45))
    assert (operator.source, len(led)) == (3, 299)


@pytest.mark.parametrize("cycle_s", [0.01, 0.02, 0.025, 1 / 30, 0.05])
def test_our_sender_counts_the_setpoints_for_which_there_was_no_time(cycle_s: float) -> None:
    """So it is followed however often it is called; the counter goes on with its clock."""
    now, bus = [5.0], ScriptedBus()
    hand = OperatorSender(bus, "ros", 100.0, clock=lambda: now[0])
    operator = Operator(LIMITS)
    for k in range(400):
        now[0] += cycle_s + 0.04 * (k == 200)
        operator.expire(now[0])
        hand.release() if k < 5 else hand.speed(0.004)
        operator.accept(bus.sent[-1].data, now[0], now[0])
        assert bool(operator.source) == (k >= 5)
    assert not operator.refused


def test_a_sender_goes_on_on_a_bus_that_raises() -> None:
    hand = OperatorSender(ScriptedBus(ValueError("garbled"), IndexError("garbled")), "script")
    for _ in range(3):
        hand.release()
        assert hand.listen() is None
    assert len(hand.bus.sent) == 3  # type: ignore[attr-defined]


@pytest.mark.parametrize("share", [0.0, 1.5])
def test_how_much_slower_a_sender_may_be_has_bounds(share: float) -> None:
    with pytest.raises(ValueError, match=r"operator\.drift_share must lie in \[0\.0005, 1\]"):
        OperatorLimits(accept=True, drift_share=share)


def test_a_reference_that_has_run_ahead_is_held_near_the_capsule() -> None:
    operator = heard(frames_of({"DeadMan": 0.0}, {"Mode": 0, "Position_m": 0.02}))
    first = operator.enabled(0.0)
    going = operator.follow(0.02, first, 0.0)
    assert going.position(np.array([2.0]))[0] > 5e-3
    operator.expire(2.0)
    assert operator.follow(2.0, going, 0.001).position(np.array([9.0]))[0] == pytest.approx(0.001 + AHEAD_M)


def test_no_bytes_raise() -> None:
    operator = Operator(LIMITS)
    for length in (0, 1, 8, 64):
        operator.accept(bytes(length), 0.0, 0.0)
        operator.accept(bytes([0xFF] * length), 0.0, float("nan"))
    assert operator.refused.total() == 8
    assert not operator.taken


@pytest.mark.parametrize("other", ["is_extended_id", "is_fd", "is_remote_frame", "is_error_frame"])
def test_frames_of_other_types_are_not_setpoints(other: str) -> None:
    kind = {"is_extended_id": False, other: True}
    operator = Operator(LIMITS)
    bus = ScriptedBus(can.Message(arbitration_id=operator.id, data=frames_of({"DeadMan": 0.0})[0], **kind))
    receiver = FrameReceiver(bus, frame_map_of("magnetic"), 2e-3, operator=operator)
    receiver.listen(0.0)
    assert receiver.strange.total() == 1
    assert operator.document() == {"presses": 0, "expired": 0, "limited": 0, "accepted": 0, "refused": {}}


def test_the_drive_moves_only_in_charge(tmp_path: Path) -> None:
    hands = Hands(("joystick", pressed(0.6, 1.0)))
    _, node = hands.run(tmp_path, 2.0)
    assert node.receiver.state not in MOVING
    assert 1e-3 < moved(node) < 2.5e-3
