"""A bus interface whose received frames can be tampered with, behind the wire's own checks: what gateways and drivers
may do.
"""

from __future__ import annotations

import copy
import heapq
import random
from collections import defaultdict, deque
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import can

from hil.bus.authenticated import PAYLOAD, authenticator, freshness, inside, sealed
from hil.bus.catalogue import Field
from hil.bus.protection import COUNTS, crc8
from hil.bus.wrapping import WrappingBus
from hil.nodes.controller.operator import SETPOINT
from hil.nodes.faults.table import Fault
from hil.nodes.frame_map import frames

_REMEMBERED: Final = 32


class FaultInjection(WrappingBus):
    """Passes `inner` on; while `faults` (fault and the identifiers it hits) are set, `recv` shows what they leave, and
    while it is `broken` it raises.

    `now` gives the time in s of the messages' stamps. A frame that comes late is stamped when it comes. The same seed
    and frames give the same result. `key` is that of an authenticated bus, of which `inner` is the wire.
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
        """The next frame that is left of what `inner` received, None where there is none now. Raises ValueError while
        broken.
        """
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

    def _drop(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        return [] if self._rng.random() < fault.amount else [frame]

    def _delay(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        return self._later(frame, fault.amount)

    def _hold_back(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        self._behind_s += fault.amount
        return self._later(frame, self._behind_s)

    def _later(self, frame: can.Message, delay_s: float) -> list[can.Message]:
        self._number += 1
        heapq.heappush(self._late, (frame.timestamp + delay_s, self._number, frame))
        return []

    def _duplicate(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        return [frame, frame]

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
        frame = copy.copy(frame)
        frame.data = data
        return [frame]

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

    def _freeze(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        return [_stamped(self._recording(frame)[-1], frame.timestamp)]

    def _miscount(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        return [_rewritten(frame, lambda bits: bits ^ COUNTS // 2 << 8)]

    def _overreach(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        place = frames()[SETPOINT].field("Position_m")
        return [_rewritten(frame, lambda bits: _with(bits, place, place.raw_upper + 1))]

    def _overask(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        speed = frames()[SETPOINT].field("Velocity_m_s")
        return [_rewritten(frame, lambda bits: _with(bits, speed, speed.raw_upper))]

    def _forge(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        return [_holding(frame, frame.data[:-1] + bytes([frame.data[-1] ^ 1]))]

    def _other_key(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        return [self._resealed(frame, bytes(byte ^ 0xFF for byte in self._key), *freshness(frame.data))]

    def _record(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        recording = self._recording(frame)
        recording.append(recording.pop(0))
        return [_stamped(recording[-1], frame.timestamp)]

    def _recording(self, frame: can.Message) -> list[can.Message]:
        """The last frames like `frame` before the fault, as many as there are counters; else it alone."""
        old = list(self._past[frame.arbitration_id])[-COUNTS:]
        return self._recorded.setdefault(frame.arbitration_id, old or [frame])

    def _unkey(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        return [inside(frame)]

    def _turn_back(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        count, epoch = freshness(frame.data)
        return [self._resealed(frame, self._key, count, epoch - 1)]

    def _resealed(self, frame: can.Message, key: bytes, count: int, epoch: int) -> can.Message:
        code = authenticator(key)
        return _holding(frame, sealed(code, frame.arbitration_id, frame.data[:PAYLOAD], count, epoch))


def _stamped(message: can.Message, time_s: float) -> can.Message:
    later = copy.copy(message)
    later.timestamp = time_s
    return later


def _holding(message: can.Message, data: bytes | bytearray) -> can.Message:
    other = copy.copy(message)
    other.data = bytearray(data)
    return other


def _rewritten(message: can.Message, change: Callable[[int], int]) -> can.Message:
    """A setpoint of which a sender has changed the bits before it made the CRC."""
    data = bytearray(change(int.from_bytes(message.data[:PAYLOAD], "little")).to_bytes(PAYLOAD, "little"))
    data[0] = crc8(memoryview(data)[1:], frames()[SETPOINT].data_id)
    return _holding(message, data + message.data[PAYLOAD:])


def _with(bits: int, field: Field, raw: int) -> int:
    mask = (1 << field.length) - 1
    return bits & ~(mask << field.start) | (raw & mask) << field.start


_TAMPERING: Final[Mapping[str, Callable[[FaultInjection, can.Message, Fault], list[can.Message]]]] = MappingProxyType(
    {
        "drop": FaultInjection._drop,
        "delay": FaultInjection._delay,
        "duplicate": FaultInjection._duplicate,
        "reorder": FaultInjection._reorder,
        "corrupt": FaultInjection._corrupt,
        "replay": FaultInjection._replay,
        "retyped": FaultInjection._retype,
        "held_back": FaultInjection._hold_back,
        "frozen_setpoint": FaultInjection._freeze,
        "miscounted": FaultInjection._miscount,
        "out_of_range": FaultInjection._overreach,
        "beyond_limits": FaultInjection._overask,
        "forged": FaultInjection._forge,
        "wrong_key": FaultInjection._other_key,
        "recorded": FaultInjection._record,
        "unkeyed": FaultInjection._unkey,
        "epoch_back": FaultInjection._turn_back,
    }
)
TAMPERING: Final = tuple(_TAMPERING)
