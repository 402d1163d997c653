"""A bus interface with fault injection: received frames are changed as faulty gateways and drivers may do."""

import copy
import heapq
import random
from collections import defaultdict, deque
from collections.abc import Callable, Mapping
from typing import Final

import can

from hil.bus.authenticated import PAYLOAD, authenticator, freshness, inside, sealed
from hil.bus.protection import COUNTS, crc8
from hil.bus.wrapping import WrappingBus
from hil.nodes.frame_map import frames
from hil.nodes.operator import SETPOINT
from hil.simulated.faults import Fault

_REMEMBERED: Final = 32  # frames of an identifier, of which one comes again


class FaultInjection(WrappingBus):
    """`recv` applies the `faults`, each with the identifiers that it hits; while `broken` it raises. `now` gives the
    time in s of the stamps. `key` belongs to an authenticated bus, whose frames on the wire `inner` carries.
    """

    def __init__(self, inner: can.BusABC, now: Callable[[], float], seed: int = 0, key: bytes = b"") -> None:
        super().__init__(inner, f"link to {inner.channel_info}")
        self.faults: list[tuple[Fault, frozenset[int]]] = []
        self.broken = False
        self._now, self._rng = now, random.Random(seed)
        self._ready: deque[can.Message] = deque()
        self._late: list[tuple[float, int, can.Message]] = []
        self._held: dict[int, can.Message] = {}
        self._recorded: dict[int, list[can.Message]] = {}
        self._behind_s = 0.0
        self._key = key
        self._past: defaultdict[int, deque[can.Message]] = defaultdict(lambda: deque(maxlen=_REMEMBERED))
        self._number = 0

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame of `inner` that the faults leave. Raises ValueError while broken."""
        if self.broken:
            raise ValueError("a line of the interface is garbled")
        now = self._now()
        while True:
            if self._late and self._late[0][0] <= now:
                due, _, message = heapq.heappop(self._late)
                return _stamped(message, due)
            if self._ready:
                return self._ready.popleft()
            message_in = self.inner.recv(timeout)
            if message_in is None:
                return None
            if not self.faults:
                self._held.clear()
                self._recorded.clear()
                self._behind_s = 0.0
                self._past[message_in.arbitration_id].append(message_in)
                return message_in
            self._ready.extend(self._tampered(message_in))

    def _tampered(self, message: can.Message) -> list[can.Message]:
        frames = [message]
        for fault, identifiers in self.faults:
            if message.arbitration_id in identifiers:
                frames = [out for frame in frames for out in _TAMPERING[fault.kind](self, frame, fault)]
        self._past[message.arbitration_id].append(message)
        return frames

    def _later(self, frame: can.Message, delay_s: float) -> list[can.Message]:
        self._number += 1
        heapq.heappush(self._late, (frame.timestamp + delay_s, self._number, frame))
        return []

    def _hold_back(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        self._behind_s += fault.amount
        return self._later(frame, self._behind_s)

    def _reorder(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        before = self._held.pop(frame.arbitration_id, None)
        if before is None:
            self._held[frame.arbitration_id] = frame
            return []
        return [frame, _stamped(before, frame.timestamp)]

    def _corrupt(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        if self._rng.random() >= fault.amount or not frame.data:
            return [frame]
        data = bytearray(frame.data)
        for bit in self._rng.sample(range(8 * len(data)), self._rng.randint(1, 8)):
            data[bit // 8] ^= 1 << bit % 8
        return [_holding(frame, data)]

    def _retype(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        self._number += 1
        kind = self._number % 4
        return [
            can.Message(
                frame.timestamp,
                frame.arbitration_id,
                kind == 0,
                is_remote_frame=kind == 1,
                is_error_frame=kind == 2,
                is_fd=kind == 3 and not frame.is_fd,
                data=None if kind == 1 else frame.data,
                is_rx=True,
                channel=frame.channel,
            )
        ]

    def _replay(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        old, back = self._past[frame.arbitration_id], int(fault.amount)
        return [frame] if len(old) < back else [frame, _stamped(old[-back], frame.timestamp)]

    def _record(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        recording = self._recording(frame)
        recording.append(recording.pop(0))
        return [_stamped(recording[-1], frame.timestamp)]

    def _recording(self, frame: can.Message) -> list[can.Message]:
        """The last frames with this identifier before the fault, as many as there are counters; else `frame`."""
        old = list(self._past[frame.arbitration_id])[-COUNTS:]
        return self._recorded.setdefault(frame.arbitration_id, old or [frame])

    def _resealed(self, frame: can.Message, flips: int = 0, back: int = 0) -> can.Message:
        """The frame authenticated anew: with a key whose bits are changed by `flips`, and an epoch `back` earlier."""
        count, epoch = freshness(frame.data)
        code = authenticator(bytes(byte ^ flips for byte in self._key))
        return _holding(frame, sealed(code, frame.arbitration_id, frame.data[:PAYLOAD], count, epoch - back))


def _stamped(message: can.Message, time_s: float) -> can.Message:
    later = copy.copy(message)
    later.timestamp = time_s
    return later


def _holding(message: can.Message, data: bytes | bytearray) -> can.Message:
    other = copy.copy(message)
    other.data = bytearray(data)
    return other


def _rewritten(message: can.Message, change: Callable[[int], int]) -> can.Message:
    data = bytearray(change(int.from_bytes(message.data[:PAYLOAD], "little")).to_bytes(PAYLOAD, "little"))
    data[0] = crc8(memoryview(data)[1:], frames()[SETPOINT].data_id)
    return _holding(message, data + message.data[PAYLOAD:])


def _asking(frame: can.Message, name: str, more: int) -> can.Message:
    """A setpoint whose signal `name` is at the end of its range, or `more` beyond it."""
    field = frames()[SETPOINT].field(name)
    mask, raw = (1 << field.length) - 1, field.raw_upper + more
    return _rewritten(frame, lambda bits: bits & ~(mask << field.start) | (raw & mask) << field.start)


_Tampered = Callable[[FaultInjection, can.Message, Fault], list[can.Message]]
_TAMPERING: Final[Mapping[str, _Tampered]] = {
    "drop": lambda link, frame, fault: [] if link._rng.random() < fault.amount else [frame],
    "delay": lambda link, frame, fault: link._later(frame, fault.amount),
    "duplicate": lambda link, frame, fault: [frame, frame],
    "reorder": FaultInjection._reorder,
    "corrupt": FaultInjection._corrupt,
    "replay": FaultInjection._replay,
    "retyped": FaultInjection._retype,
    "held_back": FaultInjection._hold_back,
    "frozen_setpoint": lambda link, frame, fault: [_stamped(link._recording(frame)[-1], frame.timestamp)],
    "miscounted": lambda link, frame, fault: [_rewritten(frame, lambda bits: bits ^ COUNTS // 2 << 8)],
    "out_of_range": lambda link, frame, fault: [_asking(frame, "Position_m", 1)],
    "beyond_limits": lambda link, frame, fault: [_asking(frame, "Velocity_m_s", 0)],
    "forged": lambda link, frame, fault: [_holding(frame, frame.data[:-1] + bytes([frame.data[-1] ^ 1]))],
    "wrong_key": lambda link, frame, fault: [link._resealed(frame, flips=0xFF)],
    "recorded": FaultInjection._record,
    "unkeyed": lambda link, frame, fault: [inside(frame)],
    "epoch_back": lambda link, frame, fault: [link._resealed(frame, back=1)],
}
"""By fault: the frames that replace a frame."""
TAMPERING: Final = tuple(_TAMPERING)
