"""A CAN bus in simulated time: arbitration, true frame lengths, error counters, bus-off. Deterministic."""

from __future__ import annotations

import copy
import heapq
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import can

from hil.bus.load import fd_frame_bits, frame_bits
from hil.bus.wrapping import OwnBus

# by ISO 11898-1
PASSIVE, BUS_OFF = 128, 256  # error counts at which a node becomes error passive, and bus-off
ERROR_BITS = 23  # of error signalling: two flags of 6, delimiter 8, space 3
SUSPENDED_BITS = 8  # pause of an error-passive sender
RECOVERY_BITS = 128 * 11  # of the idle bus that ends a bus-off
SPACE_BITS = 3  # between two frames
QUEUE = 64  # frames that wait in one node

Disturb = Callable[[float, str, can.Message], bool]
"""`(start in s, sender, message) -> True` if a bit error hits the frame on the wire."""


@dataclass(slots=True)
class Counters:
    """A node's error counters and its frames; `longest_s` is the longest time from queueing to the frame's end."""

    transmit: int = 0
    receive: int = 0
    sent: int = 0
    errors: int = 0
    longest_s: float = 0.0


class _Waiting(NamedTuple):
    """A frame in a node's queue, in order of priority; no two have the same `number`."""

    rank: int
    number: int
    queued: int
    message: can.Message


class Medium:
    """The wire; `advance` moves the time, and `shown` is called with every frame.

    Modelled: arbitration, lengths with stuff bits, error signalling, retransmission, error counters, the pause of
    passive nodes, bus-off without automatic return, collisions of one identifier, missing acknowledgement. Not
    modelled: propagation, sampling, overload and remote frames, different views of one error.
    """

    def __init__(self, bit_rate: int = 1_000_000, disturb: Disturb | None = None, data_bit_rate: int = 0) -> None:
        if not 10_000 <= bit_rate <= 1_000_000:
            raise ValueError(f"bit_rate must lie in [10000, 1000000] bit/s; got {bit_rate}")
        if data_bit_rate and not bit_rate <= data_bit_rate <= 8_000_000:
            raise ValueError(f"data_bit_rate must lie in [{bit_rate}, 8000000] bit/s, or be 0; got {data_bit_rate}")
        self.bit_rate, self.disturb, self.data_bit_rate = bit_rate, disturb, data_bit_rate
        self.ports: list[SimulatedBus] = []
        self.shown: Callable[[can.Message], None] | None = None
        self.busy_bits = 0
        self._now = self._free = 0
        self._number = 0
        self._flying: tuple[int, SimulatedBus, _Waiting] | None = None

    @property
    def now_s(self) -> float:
        return self._now / self.bit_rate

    @property
    def load(self) -> float:
        return self.busy_bits / max(self._now, self._free, 1)

    def advance(self, until_s: float) -> None:
        """Run the bus until `until_s`; frames that end by then are in the inboxes. Time never decreases."""
        end = max(round(until_s * self.bit_rate), self._now)
        while self._land(end):
            start, ready = self._contenders(end)
            if not ready:
                break
            self._transmit(start, ready)
        self._now = end

    def queue(self, port: SimulatedBus, message: can.Message) -> None:
        self._number += 1
        heapq.heappush(port.waiting, _Waiting(_rank(message), self._number, self._now, message))

    def leave(self, port: SimulatedBus) -> None:
        """Set a node bus-off, as its error counters would: its queue is lost, its frame breaks off."""
        port.counters.transmit = BUS_OFF
        port.waiting.clear()
        if self._flying is not None and self._flying[1] is port:
            self._flying = None
            self.busy_bits += self._now + ERROR_BITS - self._free
            self._free = self._now + ERROR_BITS
            for other in self.ports:
                if other is not port and self.online(other):
                    other.counters.receive = min(other.counters.receive + 1, PASSIVE)

    def recover(self, port: SimulatedBus) -> None:
        """Let a node return from bus-off after 128 times 11 bits."""
        port.offline_until = self._now + RECOVERY_BITS
        port.counters.transmit = port.counters.receive = 0

    def online(self, port: SimulatedBus) -> bool:
        return port.counters.transmit < BUS_OFF and self._now >= port.offline_until

    def _land(self, end: int) -> bool:
        """Deliver the frame on the wire if it ends by `end`; whether the wire is free."""
        if self._flying is None:
            return True
        last, sender, waiting = self._flying
        if last > end:
            return False
        self._flying, self._now = None, max(self._now, last)
        sender.counters.sent += 1
        sender.counters.transmit = max(sender.counters.transmit - 1, 0)
        sender.counters.longest_s = max(sender.counters.longest_s, (last - waiting.queued) / self.bit_rate)
        got = copy.copy(waiting.message)
        got.timestamp, got.is_rx, got.channel = last / self.bit_rate, True, sender.name
        if self.shown is not None:
            self.shown(got)
        for port in self.ports:
            counters = port.counters
            if port is not sender and counters.transmit < BUS_OFF and self._now >= port.offline_until:
                if counters.receive:
                    counters.receive = min(counters.receive - 1, PASSIVE - 1)
                port.inbox.append(got)
        return True

    def _contenders(self, end: int) -> tuple[int, list[SimulatedBus]]:
        """The first bit before `end` at which a frame can begin, and the nodes that are ready to send there."""
        start, ready = end, list[SimulatedBus]()
        for port in self.ports:
            if port.waiting:
                at = max(self._free, port.waiting[0].queued, port.suspended_until, port.offline_until)
                if at < start:
                    start, ready = at, [port]
                elif at == start < end:
                    ready.append(port)
        return start, ready

    def _transmit(self, start: int, ready: list[SimulatedBus]) -> None:
        """Arbitration at `start` between the nodes that are `ready`, and transmission by the winner."""
        self._now = max(self._now, start)
        winner = min(ready, key=_first) if len(ready) > 1 else ready[0]
        waiting = _first(winner)
        rivals = [p for p in ready if p is not winner and _first(p).rank == waiting.rank] if len(ready) > 1 else []
        if any(_first(p).message.data != waiting.message.data for p in rivals):
            self._fail(start, [winner, *rivals], waiting)
        elif not any(p is not winner and self.online(p) for p in self.ports):
            self._fail(start, [winner], waiting, acknowledged=False)
        elif self.disturb is not None and self.disturb(start / self.bit_rate, winner.name, waiting.message):
            self._fail(start, [winner], waiting)
        else:
            length = self._bits(waiting.message)
            self._occupy(start, length)
            self._flying = (start + length - SPACE_BITS, winner, heapq.heappop(winner.waiting))
            for rival in rivals:
                heapq.heappop(rival.waiting)
                rival.counters.sent += 1
            if winner.counters.transmit >= PASSIVE:
                winner.suspended_until = self._free + SUSPENDED_BITS

    def _fail(self, start: int, senders: list[SimulatedBus], waiting: _Waiting, acknowledged: bool = True) -> None:
        """An error frame: counters change; the frame stays in the queue unless its sender goes bus-off."""
        self._occupy(start, self._bits(waiting.message) // 2 + ERROR_BITS)
        for port in self.ports:
            if port in senders:
                if acknowledged or port.counters.transmit < PASSIVE:
                    port.counters.transmit += 8
                port.counters.errors += 1
                if port.counters.transmit >= PASSIVE:
                    port.suspended_until = self._free + SUSPENDED_BITS
                if port.counters.transmit >= BUS_OFF:
                    port.waiting.clear()
            elif self.online(port):
                port.counters.receive = min(port.counters.receive + 1, PASSIVE)

    def _bits(self, message: can.Message) -> int:
        if message.is_fd:
            ratio = self.data_bit_rate / self.bit_rate if message.bitrate_switch else 1.0
            return fd_frame_bits(message.is_extended_id, len(message.data), ratio)
        return frame_bits(message.arbitration_id, message.data)

    def _occupy(self, start: int, bits: int) -> None:
        self._free = start + bits
        self.busy_bits += bits


def _rank(message: can.Message) -> int:
    """The rank in arbitration, the least first: the 11 leading bits, then 11-bit frames before 29-bit ones."""
    return message.arbitration_id << 1 | 1 if message.is_extended_id else message.arbitration_id << 19


def _first(port: SimulatedBus) -> _Waiting:
    return port.waiting[0]


class SimulatedBus(OwnBus):
    """A node on a `Medium`: `recv` never waits, `send` queues at the medium's time."""

    def __init__(self, medium: Medium, name: str) -> None:
        super().__init__(channel=name)
        self.medium, self.name = medium, name
        self.channel_info = f"simulated bus, node {name}"
        self.waiting: list[_Waiting] = []
        self.inbox: deque[can.Message] = deque()
        self.counters = Counters()
        self.suspended_until = self.offline_until = 0
        medium.ports.append(self)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Queue a frame; raises CanOperationError when full or off the bus, ValueError for another type."""
        fit = msg.is_fd if self.medium.data_bit_rate and msg.is_fd else not msg.is_extended_id and not msg.is_fd
        if not fit or msg.is_remote_frame or msg.is_error_frame or len(msg.data) > (64 if msg.is_fd else 8):
            raise ValueError(f"message must be a classic data frame with an 11-bit identifier; got {msg}")
        if not self.medium.online(self):
            raise can.CanOperationError(f"node {self.name} is off the bus")
        if len(self.waiting) >= QUEUE:
            raise can.CanOperationError(f"node {self.name} has {QUEUE} frames waiting")
        self.medium.queue(self, msg)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The oldest frame that has come in, or None at once."""
        while self.inbox:
            message = self.inbox.popleft()
            if self._matches_filters(message):
                return message
        return None

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return (self.inbox.popleft() if self.inbox else None), False

    @property
    def state(self) -> can.BusState:
        """ACTIVE, PASSIVE from 128 errors on, ERROR off the bus."""
        if not self.medium.online(self):
            return can.BusState.ERROR
        worst = max(self.counters.transmit, self.counters.receive)
        return can.BusState.PASSIVE if worst >= PASSIVE else can.BusState.ACTIVE

    @state.setter
    def state(self, new_state: can.BusState) -> None:
        raise NotImplementedError("the state of a simulated node is what its error counters say")

    def recover(self) -> None:
        """Return to the bus; nothing else ends a bus-off."""
        self.medium.recover(self)

    def __del__(self) -> None:
        """Nothing to release."""

    def shutdown(self) -> None:
        super().shutdown()
        if self in self.medium.ports:
            self.medium.ports.remove(self)
