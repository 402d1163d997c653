"""Forged and repeated frames on an authenticated bus: how many were acted on, and what a frame costs.

`python -m tests.bench.bench_forgery [FRAMES]`
"""

import random
import sys
import time
from collections import Counter, deque
from typing import Final

import can
import numpy as np

from hil.bus.authenticated import LENGTH, AuthenticatedBus, authenticator
from hil.bus.catalogue import load_catalogue

FRAMES: Final = 1_000_000
KEY: Final = bytes(range(16))
_EPOCH: Final = 1_800_000_000
_KINDS: Final = ("flipped", "guessed", "grafted", "renamed", "repeated", "other key", "classic", "cut")


class Wire(can.BusABC):
    """Gives what stands in `waiting`, keeps what is sent."""

    def __init__(self) -> None:
        super().__init__(channel="wire")
        self.waiting: deque[can.Message] = deque()
        self.sent: list[can.Message] = []
        self.shutdown()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Keep it."""
        self.sent.append(msg)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        return self.waiting.popleft() if self.waiting else None


def forge(count: int, seed: int = 0) -> tuple[Counter[str], int, list[float]]:
    """`count` bad frames beside good ones: how many of each kind came, how many were acted on, and the times in s that
    good ones took to be checked. Raises AssertionError where a good one is not heard.
    """
    rng, wire = random.Random(seed), Wire()
    sender, receiver = AuthenticatedBus(wire, KEY, _EPOCH), AuthenticatedBus(wire, KEY, 1)
    wrong = authenticator(bytes(16))
    names = [frame.id for frame in load_catalogue().frames.values()]
    came, acted, took = Counter[str](), 0, list[float]()
    recent: deque[can.Message] = deque(maxlen=1000)
    while came.total() < count:
        sender.send(can.Message(arbitration_id=rng.choice(names), is_extended_id=False, data=rng.randbytes(8)))
        good = wire.sent.pop()
        recent.append(good)
        wire.waiting.append(good)
        began = time.perf_counter()
        heard = receiver.recv(0)
        took.append(time.perf_counter() - began)
        assert heard is not None
        for kind in _KINDS[: count - came.total()]:
            came[kind] += 1
            wire.waiting.append(_bad(kind, good, recent, names, wrong, rng))
            acted += receiver.recv(0) is not None
    sender.shutdown()
    receiver.shutdown()
    return came, acted, took


def _bad(kind: str, good: can.Message, recent: deque[can.Message], names: list[int], wrong, rng) -> can.Message:  # type: ignore[no-untyped-def]
    """One frame that must not be heard, made from a good one by who has no key."""
    data, identifier, fd = bytearray(good.data), good.arbitration_id, True
    ahead = (int.from_bytes(data[8:12], "little") + rng.randint(1, 1000)).to_bytes(4, "little")
    if kind == "flipped":
        for bit in rng.sample(range(8 * LENGTH), rng.randint(1, 3)):
            data[bit // 8] ^= 1 << bit % 8
    elif kind == "guessed":
        data[8:12], data[16:] = ahead, rng.randbytes(8)
    elif kind == "grafted":  # a genuine authenticator under another command
        data[:8], data[8:12] = rng.randbytes(8), ahead
    elif kind == "renamed":
        identifier = rng.choice([name for name in names if name != identifier])
    elif kind == "repeated":
        old = rng.choice(recent)
        data, identifier = bytearray(old.data), old.arbitration_id
    elif kind == "other key":
        data[8:12] = ahead
        data[16:] = wrong(identifier, bytes(data[:16]))
    elif kind == "classic":
        data, fd = data[:8], False
    else:
        data = data[: rng.choice([0, 8, 12, 16, 20])]
    return can.Message(arbitration_id=identifier, is_extended_id=False, is_fd=fd, bitrate_switch=fd, data=bytes(data))


def main(count: int) -> None:
    """Print it."""
    began = time.perf_counter()
    came, acted, took = forge(count)
    spent = time.perf_counter() - began
    print(f"{came.total()} bad frames in {spent:.1f} s, acted on: {acted}")
    print(", ".join(f"{kind} {number}" for kind, number in came.items()))
    times = 1e6 * np.array(took)
    print(f"a good frame is checked in {np.median(times):.1f} us (median), p99 {np.quantile(times, 0.99):.1f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else FRAMES)
