"""A bus interface whose received frames can be tampered with, behind the wire's own checks: what gateways and drivers
may do.
"""

from __future__ import annotations

import copy
import heapq
import random
from collections import deque
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final

import can

from hil.nodes.faults.table import Fault

_REMEMBERED: Final = 256


class FaultInjection(can.BusABC):
    """Passes `inner` on; while `faults` (fault and the identifiers it hits) are set, `recv` shows what they leave, and
    while it is `broken` it raises.

    `now` gives the time in s of the messages' stamps. A frame that comes late is stamped when it comes. The same seed
    and frames give the same result.
    """

    def __init__(self, inner: can.BusABC, now: Callable[[], float], seed: int = 0) -> None:
        super().__init__(channel=inner.channel_info)
        self.inner, self.channel_info = inner, f"link to {inner.channel_info}"
        self.faults: list[tuple[Fault, frozenset[int]]] = []
        self.broken = False
        self._now, self._rng = now, random.Random(seed)
        self._ready: deque[can.Message] = deque()
        self._late: list[tuple[float, int, can.Message]] = []
        self._held: dict[int, can.Message] = {}
        self._past: deque[can.Message] = deque(maxlen=_REMEMBERED)
        self._number = 0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """As `inner`."""
        self.inner.send(msg, timeout)

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
                self._past.append(message_in)
                return message_in
            self._ready.extend(self._tampered(message_in))

    def _tampered(self, message: can.Message) -> list[can.Message]:
        frames = [message]
        for fault, identifiers in self.faults:
            if message.arbitration_id in identifiers:
                frames = [out for frame in frames for out in _TAMPERING[fault.kind](self, frame, fault)]
        self._past.append(message)
        return frames

    def _drop(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        return [] if self._rng.random() < fault.amount else [frame]

    def _delay(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        self._number += 1
        heapq.heappush(self._late, (frame.timestamp + fault.amount, self._number, frame))
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
        if self._rng.random() >= fault.amount:
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
                is_fd=kind == 3,
                data=None if kind == 1 else frame.data,
                is_rx=True,
                channel=frame.channel,
            )
        ]

    def _replay(self, frame: can.Message, fault: Fault) -> list[can.Message]:
        old = [m for m in self._past if m.arbitration_id == frame.arbitration_id]
        back = int(fault.amount)
        return [frame] if len(old) < back else [frame, _stamped(old[-back], frame.timestamp)]

    @property
    def state(self) -> can.BusState:
        """As `inner`."""
        return self.inner.state

    @state.setter
    def state(self, new_state: can.BusState) -> None:
        self.inner.state = new_state

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return self.recv(timeout), False

    def send_periodic(self, *_: Any, **__: Any) -> Any:
        """Refused, as everywhere."""
        raise NotImplementedError("frames are sent one by one")

    def __del__(self) -> None:
        """Nothing to release, so nothing to warn of."""

    def shutdown(self) -> None:
        """Shut `inner` down."""
        super().shutdown()
        self.inner.shutdown()


def _stamped(message: can.Message, time_s: float) -> can.Message:
    later = copy.copy(message)
    later.timestamp = time_s
    return later


_TAMPERING: Final[Mapping[str, Callable[[FaultInjection, can.Message, Fault], list[can.Message]]]] = MappingProxyType(
    {
        "drop": FaultInjection._drop,
        "delay": FaultInjection._delay,
        "duplicate": FaultInjection._duplicate,
        "reorder": FaultInjection._reorder,
        "corrupt": FaultInjection._corrupt,
        "replay": FaultInjection._replay,
        "retyped": FaultInjection._retype,
    }
)
TAMPERING: Final = tuple(_TAMPERING)
