"""The lines of a page as smallest and largest values in equal spans: the last minute of a bus, or a log."""

import struct
from array import array
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hil.app.cockpit.panels import Line, Values
from hil.bus.catalogue import FrameCatalogue

Array = NDArray[np.float32]
BIN_S: Final = 0.04
"""Length of a span, and time between two pictures."""
KEPT_S: Final = 60.0  # of each line
HEAD: Final = struct.Struct("<IIdd")
"""Before the values: number of the first span, count of spans, begin of the first and length of each in s."""
_MOST_PIXELS: Final = 4000  # that a page may ask for


def packed(first: int, start_s: float, span_s: float, values: Array) -> bytes:
    """Spans in the format of the page: `values` (lines, spans, 2), little endian."""
    return HEAD.pack(first, values.shape[1], start_s, span_s) + values.astype("<f4").tobytes()


class LineFeed:
    """Which lines a frame feeds, and for how long in s each value is shown."""

    def __init__(self, lines: Sequence[Line], catalogue: FrameCatalogue) -> None:
        self.lines = tuple(lines)
        self.holds = tuple(max(5 * catalogue[one.frame].cycle_s, 2 * BIN_S) for one in lines)
        self._by_frame: dict[str, list[int]] = {}
        for number, one in enumerate(lines):
            self._by_frame.setdefault(one.frame, []).append(number)

    def values(self, name: str, last: dict[str, dict[str, float]]) -> list[tuple[int, float, float]]:
        """(line, smallest, largest) of the newest frame `name`; nan where it has no value."""
        found = []
        for number in self._by_frame.get(name, ()):
            of: Values = last[name]
            span = self.lines[number].of(of, last)
            found.append((number, *(span if span is not None else (np.nan, np.nan))))
        return found


class Ring:
    """The last `KEPT_S`, in bins of `BIN_S`; bin n holds the samples of [n, n + 1) `BIN_S`. Its memory is fixed."""

    def __init__(self, feed: LineFeed) -> None:
        count, size = len(feed.lines), round(KEPT_S / BIN_S)
        self.feed, self.size = feed, size
        self.bins = np.full((count, size, 2), np.nan, dtype=np.float32)
        self.head = 0
        self._low, self._high = [np.nan] * count, [np.nan] * count
        self._seen = [False] * count
        self._last: list[tuple[float, float, float]] = [(-np.inf, np.nan, np.nan)] * count

    def add(self, time_s: float, name: str, last: dict[str, dict[str, float]]) -> None:
        """Add a good frame; one earlier than the open bin counts in the open bin."""
        if time_s >= (self.head + 1) * BIN_S:
            self.close(time_s)
        for number, low, high in self.feed.values(name, last):
            if not self._seen[number]:
                self._low[number], self._high[number], self._seen[number] = low, high, True
            elif low == low:
                first = self._low[number] != self._low[number]
                self._low[number] = low if first else min(low, self._low[number])
                self._high[number] = high if first else max(high, self._high[number])
            self._last[number] = (time_s, low, high)

    def close(self, now: float) -> None:
        """End the bins that are over at `now`."""
        while now >= (self.head + 1) * BIN_S:
            if now - self.head * BIN_S > 2 * KEPT_S:
                self.head = int(now / BIN_S) - self.size
                self.bins[:] = np.nan
            slot, end = self.head % self.size, (self.head + 1) * BIN_S
            for number, (at, low, high) in enumerate(self._last):
                if self._seen[number]:
                    self.bins[number, slot] = self._low[number], self._high[number]
                    self._seen[number] = False
                elif end - at <= self.feed.holds[number]:
                    self.bins[number, slot] = low, high
                else:
                    self.bins[number, slot] = np.nan
            self.head += 1

    def since(self, first: int) -> bytes:
        """The closed bins from number `first` on, as far as kept."""
        first = max(first, self.head - self.size, 0)
        return packed(first, first * BIN_S, BIN_S, self.bins[:, np.arange(first, self.head) % self.size])


class Samples:
    """All samples of a log's lines, 20 bytes each."""

    def __init__(self, feed: LineFeed) -> None:
        self.feed = feed
        self._times = [array("d") for _ in feed.lines]
        self._values = [array("f") for _ in feed.lines]

    def add(self, time_s: float, name: str, last: dict[str, dict[str, float]]) -> None:
        """Add a good frame, not earlier than the one before."""
        for number, low, high in self.feed.values(name, last):
            self._times[number].append(time_s)
            self._values[number].extend((low, high))

    def window(self, begin_s: float, end_s: float, pixels: int) -> bytes:
        pixels = min(max(pixels, 1), _MOST_PIXELS)
        edges = np.linspace(begin_s, end_s, pixels + 1)
        values = np.full((len(self._times), pixels, 2), np.nan, dtype=np.float32)
        for number, hold in enumerate(self.feed.holds):
            if self._times[number]:
                times = np.frombuffer(self._times[number], dtype=np.float64)
                pairs = np.frombuffer(self._values[number], dtype=np.float32).reshape(-1, 2)
                values[number] = _spans(times, pairs, edges, hold)
        return packed(0, begin_s, (end_s - begin_s) / pixels, values)


def _spans(times: NDArray[np.float64], pairs: Array, edges: NDArray[np.float64], hold: float) -> Array:
    """Smallest and largest between edges, (spans, 2); an empty span repeats the sample before it for `hold` s."""
    at = np.searchsorted(times, edges)
    filled = at[1:] > at[:-1]
    found = np.full((len(edges) - 1, 2), np.nan, dtype=np.float32)
    if filled.any():
        starts, last = at[:-1][filled], at[1:][-1]
        found[filled, 0] = np.fmin.reduceat(pairs[:last, 0], starts)
        found[filled, 1] = np.fmax.reduceat(pairs[:last, 1], starts)
    before = np.maximum(at[:-1] - 1, 0)
    held = ~filled & (at[:-1] > 0) & (edges[1:] - times[before] <= hold)
    found[held] = pairs[before[held]]
    return found
