"""The clock of a node, a bus that stamps with it, a grid of ticks, and histograms of lateness."""

import contextlib
import time
from dataclasses import dataclass, field
from typing import Final

import can
import numpy as np
from numpy.typing import NDArray

from hil.bus.wrapping import WrappingBus
from hil.nodes.node import GRID_SLACK

OLDEST_S: Final = 0.1  # age of a kernel's stamp, beyond which the frame's arrival counts
_BINS: Final = 20_000  # of a histogram, and their width
_BIN_S: Final = 1e-6  # 1 us


class Clock:
    """Monotonic time in s since the node began, whole ns: a log keeps it to the last bit."""

    def __init__(self) -> None:
        self.origin_ns = time.monotonic_ns()

    def now(self) -> float:
        return (time.monotonic_ns() - self.origin_ns) / 1e9


class ClockedBus(WrappingBus):
    """Another bus whose frames carry times of `clock`: the driver's stamp where it is at most `oldest_s` old, else the
    moment of reading. All frames count as received, also those of other processes on this machine.
    """

    def __init__(self, inner: can.BusABC, clock: Clock, oldest_s: float = OLDEST_S) -> None:
        super().__init__(inner, inner.channel_info)
        self.clock, self.oldest_s, self.unstamped = clock, oldest_s, 0

    def recv(self, timeout: float | None = None) -> can.Message | None:
        message = self.inner.recv(timeout)
        if message is not None:
            age, now = time.time() - message.timestamp, self.clock.now()
            if not 0 <= age <= self.oldest_s:
                age, self.unstamped = 0.0, self.unstamped + 1
            message.timestamp = max(round((now - age) * 1e9), 0) / 1e9
            message.is_rx = True
        return message

    def shutdown(self) -> None:
        """Close both, also where the interface raises."""
        with contextlib.suppress(Exception):  # drivers of many makers raise whatever they like
            super().shutdown()


@dataclass
class Histogram:
    """Times in s, counted to 1 us up to 20 ms, in fixed memory."""

    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(_BINS + 1, dtype=np.int64))
    longest_s: float = 0.0

    def add(self, seconds: float) -> None:
        self.counts[min(max(int(seconds / _BIN_S), 0), _BINS)] += 1
        self.longest_s = max(self.longest_s, seconds)

    def quantile(self, share: float) -> float:
        """The time that `share` of all did not exceed, rounded up to 1 us; 0 where nothing was counted."""
        total = int(self.counts.sum())
        if not total:
            return 0.0
        k = int(np.searchsorted(np.cumsum(self.counts), share * total))
        return self.longest_s if k >= _BINS else min((k + 1) * _BIN_S, self.longest_s)

    def document(self) -> dict[str, float]:
        return {"median": 1e3 * self.quantile(0.5), "p99": 1e3 * self.quantile(0.99), "max": 1e3 * self.longest_s}


@dataclass
class Grid:
    """Ticks every `tick_s`; one a period or more late skips points (`missed`); `late` counts how late ticks begin."""

    clock: Clock
    tick_s: float
    ticks: int = 0
    missed: int = 0
    late: Histogram = field(default_factory=Histogram)
    _due: float = -1.0

    def wait(self) -> float:
        if self._due < 0:
            self._due = self.clock.now()
            self.ticks = 1
            self.late.add(0.0)
            return self._due
        self._due += self.tick_s
        left = self._due - self.clock.now()
        if left > 0:
            time.sleep(left)
        now = self.clock.now()
        self.late.add(max(now - self._due, 0.0))
        behind = int((now - self._due) / self.tick_s + GRID_SLACK)
        if behind > 0:
            self.missed += behind
            self._due += behind * self.tick_s
        self.ticks += 1
        return now
