"""The simulated bus: priority, true lengths, error counters, bus-off; the same again for the same input."""

import random
from collections.abc import Iterator

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bus.catalogue import load_catalogue
from hil.bus.load import frame_bits
from hil.bus.protection import Sender
from hil.simulated.medium import BUS_OFF, RECOVERY_BITS, Medium, SimulatedBus
from tests.hil.bus.bus_load import bus_load, longest_bits

CATALOGUE = load_catalogue()
BIT = 1e-6


def message(identifier: int, data: bytes = b"") -> can.Message:
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=False)


def plain_bits(identifier: int, data: bytes) -> list[int]:
    """The stuffed part of a frame, bit by bit, as the standard says."""
    bits = [
        0,
        *(identifier >> k & 1 for k in reversed(range(11))),
        0,
        0,
        0,
        *(len(data) >> k & 1 for k in reversed(range(4))),
    ]
    bits += [byte >> k & 1 for byte in data for k in reversed(range(8))]
    crc = 0
    for bit in bits:
        turn = bit ^ (crc >> 14 & 1)
        crc = (crc << 1 & 0x7FFF) ^ (0x4599 if turn else 0)
    return bits + [crc >> k & 1 for k in reversed(range(15))]


def stuffed(bits: list[int]) -> int:
    out: list[int] = []
    for bit in bits:
        out.append(bit)
        if len(out) >= 5 and len(set(out[-5:])) == 1 and _alone(out):
            out.append(1 - bit)
    return len(out)


def _alone(out: list[int]) -> bool:
    run = 1
    while run < len(out) and out[-run - 1] == out[-1]:
        run += 1
    return run == 5


@given(st.integers(0, 0x7FF), st.binary(max_size=8))
def test_a_frames_length_is_that_of_its_stuffed_bits(identifier: int, data: bytes) -> None:
    found = frame_bits(identifier, data)
    assert found == stuffed(plain_bits(identifier, data)) + 13
    assert 47 + 8 * len(data) <= found <= longest_bits(len(data))


def nodes(medium: Medium, *names: str) -> list[SimulatedBus]:
    return [SimulatedBus(medium, name) for name in names]


def received(bus: SimulatedBus) -> Iterator[can.Message]:
    while (got := bus.recv()) is not None:
        yield got


def test_the_lowest_identifier_goes_first_and_each_takes_its_time() -> None:
    medium = Medium()
    a, b, c = nodes(medium, "a", "b", "c")
    a.send(message(0x300, b"12345678"))
    a.send(message(0x100, b"abc"))
    b.send(message(0x200))
    medium.advance(1e-3)
    got = list(received(c))
    assert [m.arbitration_id for m in got] == [0x100, 0x200, 0x300]
    lengths = [frame_bits(0x100, b"abc"), frame_bits(0x200, b""), frame_bits(0x300, b"12345678")]
    ends = [sum(lengths[: i + 1]) - 3 for i in range(3)]
    assert [m.timestamp for m in got] == pytest.approx([end * BIT for end in ends])
    assert medium.load == pytest.approx(sum(lengths) * 1e-3)


def test_a_frame_under_way_is_not_interrupted_and_not_early() -> None:
    medium = Medium()
    a, b = nodes(medium, "a", "b")
    a.send(message(0x700, b"12345678"))
    medium.advance(20 * BIT)
    b.send(message(0x001))
    assert a.recv() is None
    medium.advance(100 * BIT)
    assert b.recv() is None
    medium.advance(1e-3)
    first, second = b.recv(), a.recv()
    assert first is not None
    assert second is not None
    assert first.timestamp < second.timestamp


def test_a_babbling_node_starves_everybody_below_it() -> None:
    medium = Medium()
    bad, good, ear = nodes(medium, "bad", "good", "ear")
    good.send(message(0x100, b"1"))
    for tick in range(1, 50):
        while len(bad.waiting) < 40:
            bad.send(message(0x000, b"\x00" * 8))
        medium.advance(tick * 1e-3)
    assert good.counters.sent == 0
    assert medium.load > 0.99
    assert all(m.arbitration_id == 0 for m in received(ear))


def test_32_errors_in_a_row_end_in_bus_off_and_nobody_comes_back_unasked() -> None:
    medium = Medium(disturb=lambda t, sender, m: sender == "a" and t < 0.5)
    a, b, _ = nodes(medium, "a", "b", "c")
    a.send(message(0x100, b"1"))
    medium.advance(0.1)
    assert a.counters.errors == BUS_OFF // 8
    assert a.state == can.BusState.ERROR
    assert b.state == can.BusState.ACTIVE
    with pytest.raises(can.CanOperationError, match="off the bus"):
        a.send(message(0x100))
    b.send(message(0x200))
    medium.advance(0.6)
    assert a.state == can.BusState.ERROR
    assert a.recv() is None
    a.recover()
    with pytest.raises(can.CanOperationError):
        a.send(message(0x100))
    medium.advance(0.6 + (RECOVERY_BITS + 1) * BIT)
    a.send(message(0x100, b"2"))
    medium.advance(0.7)
    got = list(received(b))
    assert [bytes(m.data) for m in got] == [b"2"]


def test_errors_on_the_wire_count_for_those_who_listen_too() -> None:
    medium = Medium(disturb=lambda t, sender, m: True)
    a, b = nodes(medium, "a", "b")
    a.send(message(0x100))
    medium.advance(0.1)
    assert b.counters.receive == a.counters.errors == BUS_OFF // 8


def test_a_passive_node_gives_way_after_each_frame() -> None:
    medium = Medium()
    a, b, ear = nodes(medium, "a", "b", "ear")
    a.counters.transmit = 200
    a.send(message(0x010))
    a.send(message(0x011))
    b.send(message(0x300))
    medium.advance(0.01)
    assert [m.arbitration_id for m in received(ear)] == [0x010, 0x300, 0x011]


def test_a_disturbed_frame_is_sent_again_and_the_counters_recover() -> None:
    hits = iter([True, True] + [False] * 100)
    medium = Medium(disturb=lambda t, sender, m: next(hits))
    a, b = nodes(medium, "a", "b")
    for k in range(20):
        a.send(message(0x100 + k))
    medium.advance(0.1)
    assert len(list(received(b))) == 20
    assert a.counters.transmit == 0
    assert a.counters.errors == 2
    assert b.counters.receive == 0


def test_a_sender_without_a_listener_becomes_passive_but_stays() -> None:
    medium = Medium()
    (a,) = nodes(medium, "a")
    a.send(message(0x100))
    medium.advance(0.05)
    assert a.counters.sent == 0
    assert a.state == can.BusState.PASSIVE
    (b,) = nodes(medium, "b")
    medium.advance(0.06)
    assert b.recv() is not None


def test_two_senders_of_one_identifier_destroy_each_other() -> None:
    medium = Medium()
    a, b, c = nodes(medium, "a", "b", "c")
    a.send(message(0x100, b"1"))
    b.send(message(0x100, b"2"))
    medium.advance(0.1)
    assert {a.state, b.state} == {can.BusState.ERROR}
    assert c.recv() is None


def test_what_is_not_a_plain_frame_is_refused() -> None:
    (a,) = nodes(Medium(), "a")
    with pytest.raises(ValueError, match="11-bit identifier"):
        a.send(can.Message(arbitration_id=0x100, is_extended_id=True))
    for k in range(64):
        a.send(message(k))
    with pytest.raises(can.CanOperationError, match="64 frames waiting"):
        a.send(message(100))
    with pytest.raises(NotImplementedError):
        a.send_periodic(message(1), 0.1)
    with pytest.raises(ValueError, match="bit_rate"):
        Medium(5)


def test_filters_hold() -> None:
    medium = Medium()
    a, b = nodes(medium, "a", "b")
    b.set_filters([{"can_id": 0x101, "can_mask": 0x7FF, "extended": False}])
    for k in range(4):
        a.send(message(0x100 + k))
    medium.advance(0.01)
    assert [m.arbitration_id for m in received(b)] == [0x101]


def run(seed: int) -> list[tuple[float, int, bytes]]:
    rng = random.Random(seed)
    medium = Medium(disturb=lambda t, sender, m: rng.random() < 0.05)
    buses = nodes(medium, "a", "b", "c")
    heard = []
    for tick in range(200):
        for bus in buses[:2]:
            if medium.online(bus):
                bus.send(message(rng.randrange(0x7FF), rng.randbytes(rng.randrange(9))))
        medium.advance(tick * 5e-4)
        heard += [(m.timestamp, m.arbitration_id, bytes(m.data)) for m in received(buses[2])]
    return heard


def test_the_same_seed_gives_the_same_bits() -> None:
    assert run(1) == run(1)
    assert run(1) != run(2)


def test_no_frame_of_the_catalogue_takes_longer_than_computed() -> None:
    medium = Medium(CATALOGUE.bit_rate)
    buses = {name: SimulatedBus(medium, name) for name in sorted({f.sender for f in CATALOGUE.frames.values()})}
    cyclic = [f for f in CATALOGUE.frames.values() if f.cycle_s]
    senders = {f.name: Sender(f) for f in cyclic}
    longest: dict[int, float] = {}
    for tick in range(500):
        for frame in cyclic:
            if tick % round(frame.cycle_s / 0.002) == 0:
                data = senders[frame.name].frame({f.name: f.lower for f in frame.fields})
                buses[frame.sender].send(message(frame.id, data))
        medium.advance((tick + 1) * 0.002)
        for bus in (buses["Controller"], buses["Coil"]):
            for got in received(bus):
                longest[got.arbitration_id] = max(longest.get(got.arbitration_id, 0.0), got.timestamp - tick * 0.002)
    bound = {share.id: share.delay_s for share in bus_load(CATALOGUE)}
    assert set(longest) == {frame.id for frame in cyclic}
    assert all(0 < delay <= bound[identifier] for identifier, delay in longest.items())
    assert medium.load <= sum(share.load for share in bus_load(CATALOGUE))


def test_fd_frames_switch_their_data_to_the_faster_rate() -> None:
    """A moteus command of 32 bytes at 1 and 5 Mbit/s takes less than a classic frame of 8 bytes, and arrives whole."""
    medium = Medium(data_bit_rate=5_000_000)
    a, b = nodes(medium, "a", "b")
    sent = can.Message(arbitration_id=0x8001, is_fd=True, bitrate_switch=True, data=bytes(32))
    a.send(sent)
    medium.advance(0.001)
    got = b.recv()
    assert got is not None
    assert got.equals(sent, timestamp_delta=None, check_direction=False, check_channel=False)
    assert 80 < medium.busy_bits < 135
    with pytest.raises(ValueError, match="classic data frame"):
        nodes(Medium(), "a")[0].send(sent)
