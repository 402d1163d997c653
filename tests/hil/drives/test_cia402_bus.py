"""The adapter's wire: a command leaves as a drive's words, and what the drive says is heard protected."""

from collections.abc import Iterator
from contextlib import closing

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bus.protection import Receiver
from hil.drives import cia402_protocol as cia402
from hil.drives.cia402_protocol import (
    DEVIATES,
    ENABLE_OPERATION,
    FAULTED,
    FOLLOWS,
    HALT_QUICKLY,
    LIMITED,
    OPERATION,
    RESET_FAULT,
    RPDO,
    SWITCHED_ON,
    TPDO_MORE,
    TPDO_STATE,
    statusword_of,
)
from hil.nodes.frame_map import DERATED, ENABLE, ENABLED, FAULT, OFF
from tests.hil.drives.cia402_ends import TABLE, Ends, command
from tests.hil.ticks import TICK


@pytest.fixture
def ends(request: pytest.FixtureRequest) -> Iterator[Ends]:
    """An adapter and a drive's end."""
    with closing(Ends(request.node.name)) as both:
        yield both


def test_a_command_leaves_as_words_and_counts(ends: Ends) -> None:
    ends.show(0x181, TPDO_STATE.pack(statusword_of(SWITCHED_ON), 0))
    ends.say("CarriageCommand", command(ENABLE, -0.1234567))
    assert ends.told() == [(0x201, RPDO.pack(ENABLE_OPERATION, -123457))]
    ends.say("Sync", {"Tick": 1, "Period_s": TICK})
    assert [identifier for identifier, _ in ends.told()] == [0x80, cia402.SYNC_ID]
    ends.say("ControllerHeartbeat", {"State": 2, "Uptime_s": 0.0, "Catalogue": 0})
    assert ends.told() == [(0x77F, b"\x05")]


@pytest.mark.parametrize(("target", "words"), [(0, [HALT_QUICKLY]), (1, [HALT_QUICKLY]), (2, [])])
def test_a_safe_stop_brakes_the_carriage_it_concerns(ends: Ends, target: int, words: list[int]) -> None:
    ends.show(0x181, TPDO_STATE.pack(statusword_of(OPERATION), 777))
    ends.say("SafeStop", {"Target": target, "Reason": 0})
    told = ends.told()
    assert [RPDO.unpack(data) for identifier, data in told if identifier == 0x201] == [(word, 777) for word in words]
    assert told[-1][0] == 16


def test_a_reset_is_one_edge(ends: Ends) -> None:
    ends.show(0x181, TPDO_STATE.pack(statusword_of(FAULTED), 0))
    ends.say("DriveReset", {"Target": 1, "Code": 4})
    assert ends.told() == []
    for _ in range(2):
        ends.say("CarriageCommand", command(ENABLE, 0.0))
    assert [RPDO.unpack(data)[0] for _, data in ends.told()] == [RESET_FAULT, 0]


def test_what_the_drive_says_is_heard_protected(ends: Ends) -> None:
    receiver = Receiver(ends.catalogue["CarriageFeedback"])
    assert ends.show(0x281, TPDO_MORE.pack(-20000, 0)) == []
    (heard,) = ends.show(0x181, TPDO_STATE.pack(statusword_of(OPERATION), -500000))
    values = receiver.accept(heard.data, heard.timestamp)
    assert isinstance(values, dict)
    assert values["State"] == ENABLED
    assert values["Position_m"] == pytest.approx(-0.5)
    assert values["Velocity_m_s"] == pytest.approx(-0.02)
    ends.show(0x181, TPDO_STATE.pack(statusword_of(FAULTED), 0))
    faults = ends.show(0x281, TPDO_MORE.pack(0, 0x8250))
    told = Receiver(ends.catalogue["CarriageFault"]).accept(faults[0].data, 0.0)
    assert len(faults) == 2
    assert told == {"Code": 4, "Detail": 0x8250}
    assert ends.show(0x281, TPDO_MORE.pack(0, 0x8250)) == []


def states(ends: Ends, *bits: int) -> list[float]:
    """What the controller hears of a drive in operation that shows these bits, one report after the other."""
    receiver, found = Receiver(ends.catalogue["CarriageFeedback"]), list[float]()
    for number, bit in enumerate(bits):
        for message in ends.show(0x181, TPDO_STATE.pack(statusword_of(OPERATION) | bit, 0)):
            values = receiver.accept(message.data, TICK * number)
            found += [values["State"]] if isinstance(values, dict) and "State" in values else []
    return found


def led(ends: Ends) -> None:
    """The drive is in operation and is told to stay there."""
    ends.show(0x181, TPDO_STATE.pack(statusword_of(OPERATION), 0))
    ends.say("CarriageCommand", command(ENABLE, 0.0))
    ends.told()


def test_a_following_error_stops_it(ends: Ends) -> None:
    """Bit 13, led by places: a fault, told in words, braked and not led again before it is acknowledged."""
    led(ends)
    assert states(ends, FOLLOWS, FOLLOWS | DEVIATES, FOLLOWS) == [ENABLED, FAULT, FAULT]
    assert ends.near.trouble == "cia402 node 1: following error (bit 13 of its statusword; 0x6065, 0x6066)"
    ends.say("CarriageCommand", command(ENABLE, 0.0))
    assert RPDO.unpack(ends.told()[0][1])[0] == HALT_QUICKLY
    ends.say("DriveReset", {"Target": 1, "Code": 11})
    assert (states(ends, FOLLOWS), ends.near.trouble) == ([ENABLED], "")


def test_one_that_no_longer_follows_its_target_is_stopped(ends: Ends) -> None:
    """Bit 12: away for one report is nothing, for two a fault; from the begin a brake may take 0.2 s to open."""
    led(ends)
    assert states(ends, *[0] * 98, FOLLOWS, 0, FOLLOWS, 0, 0) == [ENABLED] * 102 + [FAULT]
    assert ends.near.trouble == "cia402 node 1: it does not follow its target (bit 12 of its statusword)"


def test_one_that_never_follows_is_stopped(ends: Ends) -> None:
    led(ends)
    assert states(ends, *[0] * 100)[-2:] == [ENABLED, FAULT]


def test_bits_count_while_it_is_led_alone(ends: Ends) -> None:
    """A drive that is being braked does not follow; and in cyclic synchronous velocity bit 13 is reserved."""
    led(ends)
    ends.say("CarriageCommand", command(OFF, 0.0))
    assert FAULT not in states(ends, *[DEVIATES] * 120)
    with closing(Ends("by speeds", TABLE.but(mode="velocity"))) as speeds:
        led(speeds)
        assert states(speeds, FOLLOWS | DEVIATES, FOLLOWS | DEVIATES) == [ENABLED, ENABLED]


def test_a_limit_of_its_own_is_told(ends: Ends) -> None:
    led(ends)
    assert states(ends, FOLLOWS | LIMITED) == [DERATED]
    assert ends.near.trouble.endswith("it is at a limit of its own (bit 11 of its statusword; 0x607D, 0x607F)")
    assert states(ends, FOLLOWS) == [ENABLED]
    assert ends.near.trouble == ""


@given(st.sampled_from([0x181, 0x281, 0x701]), st.binary(max_size=8))
def test_nothing_that_a_drive_says_raises(identifier: int, data: bytes) -> None:
    with closing(Ends("fuzzed")) as ends:
        for message in ends.show(identifier, data):
            assert message.arbitration_id in (33, 32, 384, 1809)
