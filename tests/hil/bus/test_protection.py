"""Counter, CRC and age: a bad frame changes nothing and is counted."""

import math
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bus.catalogue import load_catalogue
from hil.bus.codec import Codec, FrameError, Refusal
from hil.bus.protection import COUNTS, MOST_LOST, POLYNOMIAL, RESYNC, Receiver, Reception, Sender, crc8, crc_table

CATALOGUE = load_catalogue()
COIL, STOP = CATALOGUE["CoilCommand"], CATALOGUE["SafeStop"]
VALUES = {"Current_A": 0.25, "TimeToLive_ms": 8.0, "Mode": 2.0}
TICK = COIL.cycle_s


def undetected(polynomial: int, flips: int) -> int:
    """Error patterns of `flips` bits on an 8-byte frame that leave a CRC of `polynomial` right; the CRC is linear."""
    table = crc_table(polynomial)

    def rest(data: bytes) -> int:
        crc = 0
        for byte in data:
            crc = table[crc ^ byte]
        return crc

    single = [1 << bit for bit in range(8)]
    for byte in range(7):
        for bit in range(8):
            data = bytearray(8)
            data[byte] = 1 << bit
            single.append(rest(bytes(data)))
    found = 0
    for some in combinations(single, flips - 1):
        total = 0
        for s in some:
            total ^= s
        found += sum(s == total for s in single if s not in some)
    return found // flips


def test_0x2f_misses_no_error_of_three_bits_on_eight_bytes() -> None:
    assert undetected(POLYNOMIAL, 2) == 0
    assert undetected(POLYNOMIAL, 3) == 0
    assert undetected(0x1D, 3) > 0


def test_the_crc_is_autosars() -> None:
    check = b"123456789"
    assert crc8(check[:-1], check[-1]) == 0xDF


@given(st.integers(0, 10_000), st.sets(st.integers(0, 63), min_size=1, max_size=3))
def test_no_error_of_three_bits_gets_through(count: int, flips: set[int]) -> None:
    sender, receiver = Sender(COIL), Receiver(COIL)
    for _ in range(count % COUNTS):
        sender.frame(VALUES)
    data = sender.frame(VALUES)
    wrong = (int.from_bytes(data, "little") ^ sum(1 << bit for bit in flips)).to_bytes(8, "little")
    assert receiver.accept(wrong, 0.0) == Refusal("crc")
    assert receiver.values is None
    assert receiver.accept(data, 0.0) == pytest.approx(VALUES)


@given(st.binary(max_size=12))
def test_whatever_comes_is_accepted_whole_or_changes_nothing(data: bytes) -> None:
    receiver = Receiver(COIL)
    before = receiver.accept(Sender(COIL).frame(VALUES), 0.0)
    found = receiver.accept(data, TICK)
    if isinstance(found, Refusal):
        assert receiver.values == before
        assert receiver.stamp_s == 0.0
        assert sum(receiver.refused.values()) == 1
    else:
        assert crc8(data[1:], COIL.data_id) == data[0]
        assert all(f.lower <= found[f.name] <= f.upper for f in COIL.fields)


def test_another_frames_bytes_are_refused() -> None:
    data = Sender(CATALOGUE["InnerMassCommand"]).frame(
        {"Level": 0, "Period_s": 0, "Duty": 0, "TimeToLive_ms": 8, "Mode": 2}
    )
    assert Receiver(COIL).accept(data, 0.0) == Refusal("crc")


def test_a_frame_that_is_sound_but_out_of_range_is_refused() -> None:
    bits = Codec(COIL).encode(VALUES)
    current = COIL.field("Current_A")
    bits |= ((1 << current.length - 1) - 1) << current.start
    data = bytearray(bits.to_bytes(8, "little"))
    data[0] = crc8(data[1:], COIL.data_id)
    found = Receiver(COIL).accept(data, 0.0)
    assert isinstance(found, Refusal)
    assert found.reason == "range"


def test_repeated_and_old_frames_are_refused_and_lost_ones_counted() -> None:
    sender, receiver = Sender(COIL), Receiver(COIL)
    sent = [sender.frame(VALUES) for _ in range(12)]
    assert isinstance(receiver.accept(sent[0], 0.0), dict)
    assert receiver.accept(sent[0], TICK) == Refusal("repeated", "0 then 0")
    assert receiver.accept(sent[3], TICK) == Refusal("counter", "0 then 3")
    assert isinstance(receiver.accept(sent[3], 3 * TICK), dict)
    assert (receiver.accepted, receiver.lost) == (2, 2)
    assert isinstance(receiver.accept(sent[1], 4 * TICK), Refusal)
    assert isinstance(receiver.accept(sent[3 + MOST_LOST + 2], 7.9 * TICK), Refusal)
    assert isinstance(receiver.accept(sent[3 + MOST_LOST + 1], 7.9 * TICK), dict)


@given(st.integers(2, 12), st.integers(16, 64), st.floats(0, 0.9))
def test_a_frame_that_comes_late_beside_the_others_is_refused(age: int, count: int, wait: float) -> None:
    sender, receiver = Sender(COIL), Receiver(COIL)
    sent = [sender.frame(VALUES) for _ in range(count)]
    for i, data in enumerate(sent):
        assert isinstance(receiver.accept(data, i * TICK), dict)
    assert isinstance(receiver.accept(sent[-age], (count - 1 + wait) * TICK), Refusal)


def test_data_become_invalid_with_age_and_before_their_time() -> None:
    receiver = Receiver(COIL)
    receiver.accept(Sender(COIL).frame(VALUES), 1.0)
    assert receiver.fresh(1.0 + 4.9 * TICK) == pytest.approx(VALUES)
    assert receiver.fresh(1.0 + 5.1 * TICK) is None
    assert receiver.fresh(0.9) is None
    assert receiver.fresh(math.nan) is None


def test_a_sender_that_restarts_is_believed_after_a_silence_and_a_few_frames() -> None:
    old, new, receiver = Sender(COIL), Sender(COIL), Receiver(COIL)
    for i in range(9):
        receiver.accept(old.frame(VALUES), i * TICK)
    found = [receiver.accept(new.frame(VALUES), 1.0 + i * TICK) for i in range(RESYNC)]
    assert [isinstance(f, Refusal) for f in found] == [True] * (RESYNC - 1) + [False]
    other = Sender(COIL)
    for _ in range(RESYNC):
        other.frame(VALUES)
    found = [receiver.accept(other.frame(VALUES), 2.0 + i * TICK) for i in range(RESYNC)]
    assert [isinstance(f, Refusal) for f in found] == [True] * (RESYNC - 1) + [False]


def test_a_replay_beside_the_true_sender_is_not_let_in() -> None:
    sender, receiver = Sender(COIL), Receiver(COIL)
    recorded = [Sender(COIL).frame(VALUES | {"Current_A": 2.0})]
    replayer = Sender(COIL)
    recorded = [replayer.frame(VALUES | {"Current_A": 2.0}) for _ in range(COUNTS)]
    for i in range(7):
        receiver.accept(sender.frame(VALUES), i * TICK)
    let_in = 0
    for i in range(7, 400):
        assert isinstance(receiver.accept(sender.frame(VALUES), i * TICK), dict)
        let_in += isinstance(receiver.accept(recorded[(i + 8) % COUNTS], (i + 0.5) * TICK), dict)
    assert let_in == 0


def test_a_safe_stop_is_believed_at_once_after_any_silence() -> None:
    sender, receiver = Sender(STOP), Receiver(STOP)
    stop = {"Target": 0, "Reason": 2}
    assert isinstance(receiver.accept(sender.frame(stop), 0.0), dict)
    for _ in range(11):
        sender.frame(stop)
    assert isinstance(receiver.accept(sender.frame(stop), 100.0), dict)
    restarted = Sender(STOP)
    restarted.frame(stop)
    assert isinstance(receiver.accept(restarted.frame(stop), 200.0), dict)
    same = restarted.frame(stop)
    assert isinstance(receiver.accept(same, 300.0), dict)
    assert isinstance(receiver.accept(same, 300.01), Refusal)
    assert isinstance(receiver.accept(same, 400.0), dict)


def test_an_event_stays_valid() -> None:
    fault = CATALOGUE["CoilFault"]
    receiver = Receiver(fault)
    receiver.accept(Sender(fault).frame({"Code": 2, "Detail": 0}), 0.0)
    assert receiver.fresh(1e6) == {"Code": 2, "Detail": 0}


def test_what_was_not_sent_does_not_count() -> None:
    sender = Sender(COIL)
    with pytest.raises(FrameError):
        sender.frame(VALUES | {"Current_A": math.nan})
    assert sender.frame(VALUES)[1] & 0x0F == 0


def test_identifiers_that_nobody_knows_are_counted() -> None:
    reception = Reception([COIL])
    assert reception.accept(0x123, b"", 0.0) == Refusal("unknown", "identifier 0x123")
    assert reception.unknown[0x123] == 1
    for identifier in range(0x1000, 0x3000):
        reception.accept(identifier, b"", 0.0)
    assert len(reception.unknown) == 2048
    assert isinstance(reception.accept(COIL.id, Sender(COIL).frame(VALUES), 0.0), dict)
