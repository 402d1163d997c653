"""Protection by counter, CRC and age as in AUTOSAR E2E profile 2: bad frames are ignored, old data are invalid."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping

import can

from hil.bus.catalogue import Frame, load_catalogue
from hil.bus.codec import Codec, Reason, Refusal
from hil.bus.wrapping import classic_frame

POLYNOMIAL = 0x2F  # of AUTOSAR's CRC-8
_START = _END = 0xFF  # start value and final XOR


def crc_table(polynomial: int) -> bytes:
    """The remainder of each byte b: `x^8 b mod (x^8 + polynomial)`."""
    table = bytes(range(256))
    for _ in range(8):
        table = bytes(((rest << 1) ^ polynomial) & 0xFF if rest & 0x80 else rest << 1 for rest in table)
    return table


_TABLE = crc_table(POLYNOMIAL)


def crc8(data: bytes | bytearray | memoryview, data_id: int) -> int:
    """CRC of `data` and the byte `data_id`: start 0xFF, inverted; Hamming distance 4 on 8 bytes with itself."""
    table, rest = _TABLE, _START
    for byte in data:
        rest = table[rest ^ byte]
    return table[rest ^ data_id] ^ _END


COUNTS = 16  # values of the counter's four bits
MOST_LOST = 4  # frames that a counter may skip
CYCLES = 5  # without a frame, after which data are invalid
RESYNC = 3  # good frames in a row after which data are valid again


class Sender:
    def __init__(self, frame: Frame) -> None:
        self.id, self._codec, self._counter, self._data_id = frame.id, Codec(frame), 0, frame.data_id

    def message(self, values: Mapping[str, float], stamp: float = 0.0, *, heard: bool = False) -> can.Message:
        """The next frame, for sending or as a received one (`heard`). Raises as `frame`."""
        return classic_frame(self.id, self.frame(values), stamp, heard=heard)

    def frame(self, values: Mapping[str, float]) -> bytes:
        """The next frame's bytes. Raises FrameError for values that do not fit, without counting."""
        bits = self._codec.encode(values) | self._counter << 8
        data = bytearray(bits.to_bytes(self._codec.length, "little"))
        data[0] = crc8(memoryview(data)[1:], self._data_id)
        self._counter = (self._counter + 1) % COUNTS
        return bytes(data)

    def skip(self, frames: int) -> None:
        self._counter = (self._counter + frames) % COUNTS


class FrameTransmitter:
    """Senders of the frames `names` on a bus. `unsent` counts frames that were not sent."""

    def __init__(self, bus: can.BusABC, names: Iterable[str]) -> None:
        self._bus, self._senders = bus, {name: Sender(load_catalogue()[name]) for name in names}
        self.unsent = 0

    def say(self, name: str, values: Mapping[str, float]) -> None:
        try:
            self._bus.send(self._senders[name].message(values), timeout=0)
        except Exception:  # noqa: BLE001 - drivers of many makers raise whatever they like
            self.unsent += 1

    def skip(self, name: str, frames: int) -> None:
        self._senders[name].skip(frames)


class Receiver:
    """Checks the frames of one kind: length, CRC, counter, range, in this order; keeps the last good values and their
    time.

    The counter of a cyclic frame may skip as many frames as there was time for, at most `MOST_LOST`. Once the data are
    stale, `RESYNC` good frames with consecutive counters are needed. While they are fresh no other sequence is
    accepted, so no replay beside the true sender, unless it is exactly 15 frames old. A replay after the sender fell
    silent looks like its restart; heartbeats and the time to live bound its effect. Frames that are not cyclic may have
    any counter except the last one: none of them can start a motion.
    """

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        self.longest_s = CYCLES * frame.cycle_s or math.inf  # age at which data become invalid
        self.accepted, self.lost, self.refused = 0, 0, Counter[Reason]()
        self.values: dict[str, float] | None = None
        self.stamp_s = -math.inf
        self._codec, self._data_id = Codec(frame), frame.data_id
        self.counter = self._candidate = -1  # of the last good frame, of one that is not let in yet
        self._row = 0

    def accept(self, data: bytes | bytearray, now: float) -> dict[str, float] | Refusal:
        """The values of the frame received at `now` in s, or its refusal. Never raises."""
        found = self._checked(data, now)
        if isinstance(found, Refusal):
            self.refused[found.reason] += 1
            return found
        self.values, self.stamp_s = found, now
        self.accepted += 1
        return found

    def fresh(self, now: float) -> dict[str, float] | None:
        """The last good values; None without any, or if they are older than `longest_s` or from the future."""
        return self.values if 0 <= now - self.stamp_s <= self.longest_s else None

    def _checked(self, data: bytes | bytearray, now: float) -> dict[str, float] | Refusal:
        if len(data) != self._codec.length:
            return Refusal("length", f"{len(data)} bytes")
        if crc8(memoryview(data)[1:], self._data_id) != data[0]:
            return Refusal("crc")
        counter = data[1] & 0x0F
        step = self._step(counter, now)
        if isinstance(step, Refusal):
            return step
        values = self._codec.decode(int.from_bytes(data, "little"))
        if isinstance(values, Refusal):
            return values
        self.lost += step - 1
        self.counter, self._row = counter, 0
        return values

    def _step(self, counter: int, now: float) -> int | Refusal:
        if self.counter < 0:
            return 1
        step = (counter - self.counter) % COUNTS
        fresh, cyclic = self.fresh(now) is not None, self.frame.sent == "Cyclic"
        if step and not cyclic:
            return 1
        if fresh and 1 <= step <= min(MOST_LOST, (now - self.stamp_s) / self.frame.cycle_s + 0.5) + 1:
            return step
        if fresh:
            return Refusal("repeated" if step == 0 else "counter", f"{self.counter} then {counter}")
        self._row = self._row + 1 if (counter - self._candidate) % COUNTS == 1 else 1
        self._candidate = counter
        if self._row >= RESYNC or not cyclic:
            return 1
        return Refusal("counter", f"frame {self._row} of {RESYNC} after a silence")


class Reception:
    """Receivers of frames by identifier; other identifiers are counted in `unknown`."""

    def __init__(self, frames: Iterable[Frame]) -> None:
        self.receivers = {frame.id: Receiver(frame) for frame in frames}
        self.unknown: Counter[int] = Counter()

    @property
    def refused(self) -> int:
        return sum(receiver.refused.total() for receiver in self.receivers.values())

    def accept(self, identifier: int, data: bytes | bytearray, now: float) -> dict[str, float] | Refusal:
        """Pass a frame to its receiver. Never raises; counts at most 2048 unknown identifiers."""
        receiver = self.receivers.get(identifier)
        if receiver is None:
            if len(self.unknown) < 2048 or identifier in self.unknown:
                self.unknown[identifier] += 1
            return Refusal("unknown", f"identifier {identifier:#x}")
        return receiver.accept(data, now)
