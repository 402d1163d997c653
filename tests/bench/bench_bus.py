"""The bus's figures: a million fuzzed frames, what codec and protection cost beside cantools, load, and the simulated
bus's pace.

`python -m tests.bench.bench_bus [FRAMES]`
"""

import random
import sys
import time
from collections import Counter
from collections.abc import Callable

import can
import cantools

from hil.bus.catalogue import DBC, Frame, load_catalogue
from hil.bus.codec import Codec, Refusal
from hil.bus.protection import Receiver, Sender, crc8
from hil.simulated.medium import Medium, SimulatedBus
from tests.hil.bus.bus_load import bus_load

CATALOGUE = load_catalogue()
FRAMES = 1_000_000
TICK = 0.002


def values(frame: Frame, rng: random.Random) -> dict[str, float]:
    """Something in range for every signal."""
    return {
        f.name: float(rng.choice(sorted(f.names))) if f.names else rng.uniform(f.lower, f.upper) for f in frame.fields
    }


def flipped(data: bytes, rng: random.Random) -> bytes:
    bits = rng.sample(range(64), rng.randint(1, 3))
    return (int.from_bytes(data, "little") ^ sum(1 << bit for bit in bits)).to_bytes(8, "little")


def forged(frame: Frame, counter: int, rng: random.Random) -> bytes:
    """A sound frame of one signal out of range, where the frame has room for that."""
    wild = [f for f in frame.fields if f.raw_upper - f.raw_lower + 1 < 1 << f.length and not f.names]
    if not wild:
        return b""
    f = rng.choice(wild)
    raw = f.raw_upper + rng.randint(1, (1 << f.length) - 1 - (f.raw_upper - f.raw_lower))
    bits = Codec(frame).encode(values(frame, rng)) & ~(((1 << f.length) - 1) << f.start) | counter << 8
    data = bytearray((bits | (raw & ((1 << f.length) - 1)) << f.start).to_bytes(8, "little"))
    data[0] = crc8(data[1:], frame.data_id)
    return bytes(data)


def fuzz(count: int, seed: int = 0) -> tuple[Counter[str], Counter[str]]:
    """Bad frames between good ones: how many of each kind came, and how many were acted on; the good ones must all get
    in.
    """
    rng = random.Random(seed)
    senders = {f.name: Sender(f) for f in CATALOGUE.frames.values()}
    receivers = {f.name: Receiver(f) for f in CATALOGUE.frames.values()}
    last: dict[str, list[bytes]] = {name: [] for name in receivers}
    kinds = ("flipped", "repeated", "replayed", "foreign", "forged", "short")
    came, acted = Counter[str](), Counter[str]()
    frames = [f for f in CATALOGUE.frames.values() if f.sent == "Cyclic"]
    now = dict.fromkeys(receivers, 0.0)
    while came.total() < count:
        frame = rng.choice(frames)
        receiver, recent = receivers[frame.name], last[frame.name]
        data = senders[frame.name].frame(values(frame, rng))
        now[frame.name] += frame.cycle_s
        if isinstance(receiver.accept(data, now[frame.name]), Refusal):
            acted["good frame refused"] += 1
        recent.append(data)
        del recent[:-12]
        held = (receiver.values, receiver.stamp_s)
        for kind in kinds:
            bad = _bad(kind, frame, recent, rng)
            if not bad:
                continue
            came[kind] += 1
            found = receiver.accept(bad, now[frame.name] + rng.uniform(0, 0.9) * frame.cycle_s)
            if not isinstance(found, Refusal) or held != (receiver.values, receiver.stamp_s):
                acted[kind] += 1
    return came, acted


def _bad(kind: str, frame: Frame, recent: list[bytes], rng: random.Random) -> bytes:
    data = recent[-1]
    if kind == "flipped":
        return flipped(data, rng)
    if kind == "repeated":
        return data
    if kind == "replayed":
        return rng.choice(recent[:-1]) if len(recent) > 1 else b""
    if kind == "foreign":
        other = rng.choice([f for f in CATALOGUE.frames.values() if f is not frame])
        return Sender(other).frame(values(other, rng))
    if kind == "forged":
        return forged(frame, (data[1] + 1) & 0x0F, rng)
    return data[: rng.randrange(8)] or b"\x00"


def microseconds(call: Callable[[], object], count: int = 20_000) -> float:
    """Mean time of a call."""
    began = time.perf_counter()
    for _ in range(count):
        call()
    return 1e6 * (time.perf_counter() - began) / count


def codec_times() -> None:
    """Codec with protection beside cantools without, in the same run."""
    frame = CATALOGUE["CarriageCommand"]
    some = values(frame, random.Random(0))
    peer = cantools.database.load_file(DBC).get_message_by_name(frame.name)
    sender, receiver = Sender(frame), Receiver(frame)
    data = iter([sender.frame(some) for _ in range(20_000)])
    ours = microseconds(lambda: sender.frame(some)), microseconds(lambda: receiver.accept(next(data), 0.0))
    plain = {**some, "CRC": 0, "Counter": 0}
    one = sender.frame(some)
    theirs = microseconds(lambda: peer.encode(plain), 5000), microseconds(lambda: peer.decode(one), 5000)
    print(
        f"encode and protect {ours[0]:.1f} us, check and decode {ours[1]:.1f} us; cantools {theirs[0]:.1f},"
        f" {theirs[1]:.1f} us"
    )


def pace(seconds: float = 5.0) -> None:
    """All cyclic frames through the simulated bus, coded, protected, sent, received and checked."""
    medium = Medium(CATALOGUE.bit_rate)
    cyclic = [f for f in CATALOGUE.frames.values() if f.sent == "Cyclic"]
    buses = {name: SimulatedBus(medium, name) for name in sorted({f.sender for f in cyclic})}
    senders, receivers = {f.name: Sender(f) for f in cyclic}, {f.id: Receiver(f) for f in cyclic}
    some = {f.name: values(f, random.Random(1)) for f in cyclic}
    began, busy, count = time.perf_counter(), time.process_time(), 0
    for tick in range(round(seconds / TICK)):
        for frame in cyclic:
            if tick % round(frame.cycle_s / TICK) == 0:
                data = senders[frame.name].frame(some[frame.name])
                buses[frame.sender].send(can.Message(arbitration_id=frame.id, data=data, is_extended_id=False))
        medium.advance((tick + 1) * TICK)
        while (got := buses["Controller"].recv()) is not None:
            receivers[got.arbitration_id].accept(got.data, got.timestamp)
            count += 1
        for name in buses:
            buses[name].inbox.clear()
    wall, used = time.perf_counter() - began, time.process_time() - busy
    print(
        f"simulated bus: {seconds / wall:.1f} x real time ({seconds / used:.1f} x by processor time), {medium.load:.1%}"
        " load, ",
        end="",
    )
    print(f"{count / seconds:.0f} frames/s to the controller")


def main() -> None:
    """Print everything; status 1 where a bad frame was acted on."""
    codec_times()
    pace()
    shares = bus_load(CATALOGUE)
    print(f"load with every stuff bit: {sum(s.load for s in shares):.1%} of 1 Mbit/s")
    for share in shares:
        print(
            f"  {share.id:#05x} {share.name:22s} {share.rate_Hz:5.0f} Hz {share.load:6.2%}  at most"
            f" {1e3 * share.delay_s:.2f} ms"
        )
    began = time.perf_counter()
    came, acted = fuzz(int(sys.argv[1]) if len(sys.argv) > 1 else FRAMES)
    print(
        f"bad frames: {came.total()} ({dict(came)}), acted on: {dict(acted) or 0}, {time.perf_counter() - began:.0f} s"
    )
    sys.exit(1 if acted else 0)


if __name__ == "__main__":
    main()
