"""The states of a CiA 402 drive and the words between: those of another program, and only one way to operation."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.drives.cia402_protocol import (
    DISABLED,
    ENABLE_OPERATION,
    FAULTED,
    HALT_QUICKLY,
    NOT_READY,
    OPERATION,
    QUICK_STOPPING,
    REACTING,
    READY_TO_SWITCH_ON,
    RESET_FAULT,
    SWITCHED_ON,
    controlword,
    fault_of,
    next_state,
    shown,
    state_of,
    statusword_of,
)
from hil.nodes.frame_map import (
    BOOT,
    DERATED,
    ENABLE,
    ENABLED,
    FAULT,
    OFF,
    QUICK_STOP,
    READY,
    STANDBY,
    STOPPING,
    WAITING,
)

STATES = range(NOT_READY, FAULTED + 1)

NAMES = (
    "NOT READY TO SWITCH ON",
    "SWITCH ON DISABLED",
    "READY TO SWITCH ON",
    "SWITCHED ON",
    "OPERATION ENABLED",
    "QUICK STOP ACTIVE",
    "FAULT REACTION ACTIVE",
    "FAULT",
)


def test_statuswords_are_those_of_another_program() -> None:
    """canopen's own table of masks names the same state for every 16-bit word."""
    peer = pytest.importorskip("canopen.profiles.p402", reason="needs the package canopen (extra canopen)")
    masks = peer.State402.SW_MASK
    for word in range(1 << 16):
        named = [name for name, (mask, value) in masks.items() if word & mask == value]
        assert NAMES[state_of(word)] == (named[0] if named else NAMES[NOT_READY])
    words = peer.State402.CW_COMMANDS_CODE
    assert (words["OPERATION ENABLED"], words["QUICK STOP ACTIVE"], words["SWITCH ON DISABLED"]) == (
        ENABLE_OPERATION,
        HALT_QUICKLY,
        RESET_FAULT,
    )


def test_what_a_drive_shows() -> None:
    expected = (BOOT, STANDBY, WAITING, WAITING, ENABLED, STOPPING, FAULT, FAULT)
    assert tuple(shown(statusword_of(state)) for state in STATES) == expected
    assert shown(statusword_of(OPERATION, warning=True)) == DERATED
    assert shown(statusword_of(SWITCHED_ON, warning=True)) == WAITING
    assert [fault_of(e) for e in (0x2310, 0x4310, 0x8250, 0x8130, 0x8611)] == [1, 2, 4, 5, 11]


@given(
    st.sampled_from(STATES),
    st.lists(st.tuples(st.sampled_from([OFF, READY, ENABLE, QUICK_STOP]), st.booleans()), max_size=12),
)
def test_enabled_only_by_ready_then_enable(state: int, asked: list[tuple[int, bool]]) -> None:
    """From wherever a drive stands, operation is reached only over "ready" while disabled, with "enable" asked for
    afterwards; no reset gets further than "disabled".
    """
    before, readied = 0, state in (READY_TO_SWITCH_ON, SWITCHED_ON, OPERATION)
    for mode, reset in asked:
        word = controlword(mode, state, reset=reset)
        after = next_state(state, word, before, cause=False, at_rest=True)
        if state == FAULTED:
            assert after == (DISABLED if reset and not before & RESET_FAULT else FAULTED)
        if state == DISABLED:
            readied = mode == READY
            assert after == (READY_TO_SWITCH_ON if readied else DISABLED)
        if after == OPERATION:
            assert readied
            assert mode == ENABLE
        state, before = after, word


@pytest.mark.parametrize("mode", [OFF, READY, QUICK_STOP])
def test_whatever_stops_a_moving_drive_brakes_it(mode: int) -> None:
    word = controlword(mode, OPERATION)
    assert word == HALT_QUICKLY
    state = next_state(OPERATION, word, ENABLE_OPERATION, cause=False, at_rest=False)
    assert state == QUICK_STOPPING
    assert controlword(mode, state) == controlword(ENABLE, state) == HALT_QUICKLY
    assert next_state(state, word, word, cause=False, at_rest=False) == QUICK_STOPPING
    assert next_state(state, word, word, cause=False, at_rest=True) == DISABLED


def test_a_fault_brakes_then_is_latched_while_its_cause_lasts() -> None:
    assert next_state(OPERATION, ENABLE_OPERATION, 0, cause=True, at_rest=False) == REACTING
    assert next_state(REACTING, ENABLE_OPERATION, 0, cause=True, at_rest=False) == REACTING
    assert next_state(REACTING, ENABLE_OPERATION, 0, cause=True, at_rest=True) == FAULTED
    assert next_state(FAULTED, RESET_FAULT, 0, cause=True, at_rest=True) == FAULTED
    assert next_state(FAULTED, RESET_FAULT, RESET_FAULT, cause=False, at_rest=True) == FAULTED
    assert next_state(FAULTED, RESET_FAULT, 0, cause=False, at_rest=True) == DISABLED
