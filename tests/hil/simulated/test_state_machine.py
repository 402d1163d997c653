"""A drive's state machine: the only way up, the ways out of operation, and what ends a fault."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.nodes.frame_map import (
    DERATED,
    ENABLE,
    ENABLED,
    FAULT,
    MOVING,
    OFF,
    OVER_CURRENT,
    QUICK_STOP,
    READY,
    SELF_TEST,
    STANDBY,
    STOPPING,
    TIME_TO_LIVE,
    WAITING,
)
from hil.simulated.state_machine import BOOT_S, SELF_TEST_S, DriveFacts, Stage, next_stage
from tests.hil.ticks import SLOT

LEAD = (OFF, READY, ENABLE)


def led(*modes: int, start: Stage | None = None, **more: object) -> Stage:
    """A drive that has been told `modes` one after the other, from standby."""
    stage = start or Stage(STANDBY)
    for mode in modes:
        stage = next_stage(stage, DriveFacts(mode, **{"alive": True, "answered": True, **more}), 1.0)  # type: ignore[arg-type]
    return stage


def test_boot_and_self_test_take_their_time() -> None:
    stage, states = Stage(), []
    for k in range(60):
        stage = next_stage(stage, DriveFacts(ENABLE, alive=True), k * SLOT)
        states.append(stage.state)
    assert states.index(SELF_TEST) == round(BOOT_S / SLOT)
    assert states.index(STANDBY) == round((BOOT_S + SELF_TEST_S) / SLOT)
    assert states[-1] == STANDBY


def test_only_off_ready_enable_in_turn_leads_up() -> None:
    assert led(*LEAD).state == ENABLED
    for modes in ((READY, ENABLE), (ENABLE,), (OFF, ENABLE), (OFF, QUICK_STOP, ENABLE), (READY, READY, ENABLE)):
        assert led(*modes).state in (STANDBY, WAITING)
        assert led(*modes).state not in MOVING
    assert led(*LEAD, answered=False).state == STANDBY


@pytest.mark.parametrize(
    ("told", "state"),
    [
        (DriveFacts(ENABLE, True), ENABLED),
        (DriveFacts(ENABLE, True, hot=True), DERATED),
        (DriveFacts(OFF, True, at_rest=False), STOPPING),
        (DriveFacts(READY, True), STOPPING),
        (DriveFacts(QUICK_STOP, True), STOPPING),
        (DriveFacts(ENABLE, True, safe_stop=True), STOPPING),
        (DriveFacts(ENABLE, False), FAULT),
        (DriveFacts(ENABLE, True, cause=OVER_CURRENT), FAULT),
    ],
)
def test_leaving_operation(told: DriveFacts, state: int) -> None:
    assert next_stage(led(*LEAD), told, 2.0).state == state
    assert next_stage(Stage(DERATED), told, 2.0).state == state


def test_a_stop_ends_in_standby_at_rest_and_needs_the_whole_way_up_again() -> None:
    stopping = next_stage(led(*LEAD), DriveFacts(QUICK_STOP, True, at_rest=False), 2.0)
    assert next_stage(stopping, DriveFacts(ENABLE, True, at_rest=False), 2.0).state == STOPPING
    rested = next_stage(stopping, DriveFacts(ENABLE, True), 2.0)
    assert rested == Stage(STANDBY, 2.0)
    assert led(READY, ENABLE, start=rested).state == STANDBY
    assert led(*LEAD, start=rested).state == ENABLED


@pytest.mark.parametrize(
    "told",
    [
        DriveFacts(OFF, True),
        DriveFacts(READY, False),
        DriveFacts(READY, True, safe_stop=True),
        DriveFacts(QUICK_STOP, True),
    ],
)
def test_ready_falls_back_to_standby(told: DriveFacts) -> None:
    assert next_stage(led(OFF, READY), told, 2.0) == Stage(STANDBY, 2.0)


@given(
    told=st.lists(
        st.builds(
            DriveFacts,
            mode=st.integers(0, 3),
            alive=st.booleans(),
            safe_stop=st.booleans(),
            reset=st.sampled_from([0, 1, 2, TIME_TO_LIVE, 5]),
            cause=st.sampled_from([0, 0, 0, 1, 2, 5]),
            hot=st.booleans(),
            at_rest=st.booleans(),
            answered=st.booleans(),
        ),
        max_size=40,
    )
)
def test_no_way_around_the_order(told: list[DriveFacts]) -> None:
    """A latched fault ends only by its own reset with its cause gone, in standby; operation begins only from ready by a
    live enable.
    """
    stage = Stage(STANDBY)
    for k, one in enumerate(told):
        after = next_stage(stage, one, float(k))
        if stage.state == FAULT and after.state != FAULT:
            assert after.state == STANDBY
            assert (one.reset, one.cause, one.at_rest) == (stage.fault, 0, True)
            assert not after.armed
        if after.state in MOVING and stage.state not in MOVING:
            assert stage.state == WAITING
            assert (one.mode, one.alive, one.safe_stop, one.cause) == (ENABLE, True, False, 0)
        if after.state == WAITING != stage.state:
            assert one.answered
        if after.state in MOVING:
            assert (one.alive, one.safe_stop, one.mode) == (True, False, ENABLE)
        assert (after.fault > 0) == (after.state == FAULT)
        stage = after
