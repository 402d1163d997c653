"""What stops a drive that somebody steers keeps it stopped: a key that was held through it does not count, a stop never
enables, and the end of the range is stood at.
"""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.reference import SetpointMove, move
from hil.bus.catalogue import load_catalogue
from hil.nodes.frame_map import ENABLED, MOVING
from hil.nodes.operator import Operator, OperatorLimits
from hil.nodes.operator_sender import OperatorSender
from tests.hil.nodes.test_operator import LIMITS, Hands, frames_of, pressed

A = LIMITS.acceleration_m_s2


@pytest.mark.parametrize("since", [0.7 + 0.02 * k for k in range(0, 16, 3)])
def test_a_key_that_was_held_through_a_stop_must_be_released_by_its_own_side(tmp_path: Path, since: float) -> None:
    """Two nodes send as one source: one holds its key, the other only lets go, whatever its counter is."""

    def other(hand: OperatorSender, now: float) -> None:
        if now >= since:
            hand.release()

    hands = Hands(("keyboard", pressed(0.6, 9.0)), ("keyboard", other))
    _, node = hands.run(tmp_path, 2.5)
    t, x, state = hands.paths
    assert np.ptp(x[t > since + 0.11]) == 0
    assert not set(state[t > since + 0.5]) & set(MOVING)
    assert node.operator is not None
    assert sum(node.operator.refused[why] for why in ("not_released", "counter", "repeated")) > 20


def test_released_by_its_own_side_it_counts_again(tmp_path: Path) -> None:
    def first(hand: OperatorSender, now: float) -> None:
        hand.speed(0.004) if 0.6 <= now < 1.4 or now >= 1.8 else hand.release()

    def other(hand: OperatorSender, now: float) -> None:
        if 1.0 <= now < 1.1:
            hand.release()

    hands = Hands(("keyboard", first), ("keyboard", other))
    hands.run(tmp_path, 2.5)
    t, _, state = hands.paths
    assert not set(state[(t > 1.42) & (t < 1.8)]) & set(MOVING)
    assert set(state[(t > 2.1) & (t < 2.7)]) == {ENABLED}


def test_a_stop_never_enables(tmp_path: Path) -> None:
    """Speed 0 from another source, held, while the drive stands by: nothing."""
    hands = Hands(("joystick", pressed(0.6, 1.0)), ("cockpit", pressed(1.6, 1.9, 0.0)))
    _, node = hands.run(tmp_path, 2.0)
    t, x, state = hands.paths
    assert ENABLED in state[t < 1.3]
    assert not set(state[t > 1.4]) & {*MOVING, 3}, "not even ready"
    assert np.ptp(x[t > 1.4]) == 0
    assert node.operator is not None
    assert (node.operator.presses, node.operator.refused["busy"]) == (1, 0)


def test_a_stop_counts_from_any_source(tmp_path: Path) -> None:
    """Whoever steers is let go at once, the drive stopped, and the key that is still held is none."""
    hands = Hands(("joystick", pressed(0.6, 9.0)), ("cockpit", pressed(1.0, 1.15, 0.0)))
    _, node = hands.run(tmp_path, 2.0)
    t, x, state = hands.paths
    assert np.all(np.diff(x[(t > 0.7) & (t < 1.0)]) > 0)
    assert np.ptp(x[t > 1.02]) == 0
    assert not set(state[t > 1.42]) & set(MOVING)
    assert node.operator is not None
    assert node.operator.refused["not_released"] > 20


def steered(
    reference: SetpointMove, values: dict[str, float], limits: OperatorLimits = LIMITS
) -> tuple[np.ndarray, Operator, str]:
    """Where the reference goes in a second in which the same setpoint comes fifty times with a speed that trembles, and
    why the controller says it does not go further.
    """
    operator, catalogue = Operator(limits), load_catalogue()
    operator.accept(frames_of({"DeadMan": 0.0})[0], 0.0, 0.0)
    trembling = [{**values, "Velocity_m_s": values["Velocity_m_s"] * (1 + 0.01 * (k % 2))} for k in range(51)]
    places, why = [], "none"
    for k, data in enumerate(frames_of({"DeadMan": 0.0}, *trembling)[1:]):
        operator.accept(data, 0.02 + 0.02 * k, 0.02 + 0.02 * k)
        for now in 0.02 + 0.02 * k + 2e-3 * np.arange(10):
            reference = operator.follow(now, reference, 0.0)  # type: ignore[assignment]
            places.append(float(reference.position(np.array([now]))[0]))
        status, frame = operator.status(now, reference, True), catalogue["OperatorStatus"]
        why, state = (frame.field(name).names[int(status[name])] for name in ("Refused", "State"))
        assert (state == "moving") == (bool(status["Velocity_m_s"]) and why == "none")
    return np.array(places), operator, why


@given(place=st.floats(0.0, 0.06), speed=st.floats(0.0, 0.005), ahead=st.booleans(), sign=st.sampled_from([1.0, -1.0]))
def test_the_reference_never_goes_against_the_direction_that_is_pressed(
    place: float, speed: float, ahead: bool, sign: float
) -> None:
    """From wherever it is and however fast, within the range, beyond it, or too fast to stop at its end."""
    limits = OperatorLimits(accept=True, lowest_m=-0.02, highest_m=0.02)
    moving = move(sign * (place + 0.005), sign * place, sign * speed, 0.005, A, 0.02)
    values = {"Mode": 0.0, "Position_m": sign * 0.5} if ahead else {"Mode": 1.0}
    places, _, _ = steered(moving, {**values, "Velocity_m_s": sign * 0.005}, limits)
    stops = place + speed**2 / (2 * A)
    assert np.all(np.diff(sign * places) >= -1e-12)
    assert np.max(sign * places) <= max(limits.highest_m, stops) + 1e-6


@pytest.mark.parametrize("values", [{"Mode": 1.0}, {"Mode": 0.0, "Position_m": 0.5}])
def test_the_end_of_the_range_is_told_and_counted_once(values: dict[str, float]) -> None:
    near = move(0.0195, 0.0195, 0.0, 0.005, A, 0.0)
    places, operator, why = steered(near, {**values, "Velocity_m_s": 0.005})
    assert places[-1] == pytest.approx(LIMITS.highest_m, abs=1e-9)
    assert (why, operator.limited, dict(operator.refused)) == ("range", 1, {})
    _, operator, why = steered(near, {**values, "Position_m": 0.0, "Velocity_m_s": -0.005})
    assert (why, operator.limited) == ("none", 0)
