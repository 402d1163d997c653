"""Sources of frames for the page, a bus that is only read or a log, and their lines as spans."""

import struct
from array import array
from collections.abc import Iterable, Sequence
from typing import Any, Final

import can
import numpy as np
from numpy.typing import NDArray

from hil.app.cockpit.panels import Facts, Line, panels_of
from hil.app.cockpit.phrases import TEXT
from hil.app.cockpit.watch import FrameWatch
from hil.app.run.clock import Clock
from hil.bus.catalogue import FrameCatalogue
from hil.bus.wrapping import plain
from hil.log.blf_file import NOTED, Logged
from hil.own_process import error_text

Array = NDArray[np.float32]
BIN_S: Final = 0.04  # Length of a span, and time between two pictures
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
        spans = ((number, self.lines[number].value(last[name], last)) for number in self._by_frame.get(name, ()))
        return [(number, *(span or (np.nan, np.nan))) for number, span in spans]


class Ring:
    """The last `KEPT_S`, in bins of `BIN_S`; bin n holds the samples of [n, n + 1) `BIN_S`. Its memory is fixed."""

    def __init__(self, feed: LineFeed) -> None:
        count, size = len(feed.lines), round(KEPT_S / BIN_S)
        self.feed, self.size = feed, size
        self.bins = np.full((count, size, 2), np.nan, dtype=np.float32)
        self.head = 0
        self._open: dict[int, tuple[float, float]] = {}
        self._last: list[tuple[float, float, float]] = [(-np.inf, np.nan, np.nan)] * count

    def add(self, time_s: float, name: str, last: dict[str, dict[str, float]]) -> None:
        """Add a good frame; one earlier than the open bin counts in the open bin."""
        if time_s >= (self.head + 1) * BIN_S:
            self.close(time_s)
        for number, low, high in self.feed.values(name, last):
            lowest, highest = self._open.get(number, (np.nan, np.nan))
            self._open[number] = float(np.fmin(lowest, low)), float(np.fmax(highest, high))
            self._last[number] = (time_s, low, high)

    def close(self, now: float) -> None:
        while now >= (self.head + 1) * BIN_S:
            if now - self.head * BIN_S > 2 * KEPT_S:
                self.head = int(now / BIN_S) - self.size
                self.bins[:] = np.nan
            slot, end = self.head % self.size, (self.head + 1) * BIN_S
            for number, (at, low, high) in enumerate(self._last):
                if number in self._open:
                    self.bins[number, slot] = self._open.pop(number)
                elif end - at <= self.feed.holds[number]:
                    self.bins[number, slot] = low, high
                else:
                    self.bins[number, slot] = np.nan
            self.head += 1

    def since(self, first: int) -> bytes:
        first = max(first, self.head - self.size, 0)
        return packed(first, first * BIN_S, BIN_S, self.bins[:, np.arange(first, self.head) % self.size])


class Samples:
    def __init__(self, feed: LineFeed) -> None:
        self.feed = feed
        self._times = [array("d") for _ in feed.lines]
        self._values = [array("f") for _ in feed.lines]

    def add(self, time_s: float, name: str, last: dict[str, dict[str, float]]) -> None:
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


BUSY_S: Final = 0.02  # Longest time to read frames for one picture; further frames wait for the next one
QUIET_S: Final = 0.5  # without a frame, after which the page reports it
AWAY_S: Final = 0.25  # After such a pause of this process the queue of a bus may have overflowed
SNAPSHOTS: Final = 2000  # of a log's state at most
LOG_EVENTS: Final = 5000  # of a log that are kept
SHORTEST_S: Final = 0.1  # between two snapshots
CALENDAR_S: Final = 1e6  # a later stamp is a date


class BusSource:
    """Frames of `bus`, with times of `clock`, up to the last `poll`."""

    def __init__(self, bus: can.BusABC, clock: Clock, facts: Facts) -> None:
        self.bus, self.clock, self.facts = bus, clock, facts
        self.watch = FrameWatch(facts.catalogue)
        self.ring = Ring(_feed(facts))
        self._trouble, self._heard, self._polled = "", -1.0, clock.now()

    def poll(self) -> None:
        """Read the frames since the last call; a bus that raises is reported and tried again."""
        until, waits = self.clock.now() + BUSY_S, True
        try:
            while waits and self.clock.now() < until:
                message = self.bus.recv(0)
                waits = message is not None
                if message is not None and plain(message):
                    self._take(message)
            self._trouble = ""
        except Exception as error:  # noqa: BLE001 - drivers of many makers raise whatever they like
            waits = False
            self._trouble = TEXT("source.unreadable", why=error_text(error, 160))
        now = self.clock.now()
        if now - self._polled > AWAY_S:
            self.say(TEXT("source.away", seconds=now - self._polled), "doubt")
        self._polled = now
        reached = max(self._heard, 0.0) if waits else now
        self.watch.tick(reached)
        self.ring.close(reached)

    def say(self, words: str, grade: str = "note") -> None:
        self.watch.say(self.clock.now(), words, grade)

    def _take(self, message: can.Message) -> None:
        self._heard = message.timestamp
        good = self.watch.take(message.timestamp, message.arbitration_id, bytes(message.data))
        if good is not None:
            self.ring.add(message.timestamp, good[0], self.watch.last)

    def document(self) -> dict[str, Any]:
        now = self.clock.now()
        quiet = now - self._heard
        heard = TEXT("source.silent") if self._heard < 0 else TEXT("source.quiet", seconds=quiet)
        trouble = self._trouble or (heard if self._heard < 0 or quiet > QUIET_S else "")
        return {**self.watch.document(), "time_s": round(now, 3), "trouble": trouble}


class LogSource:
    """A whole log: all samples of its lines, and the state at `SNAPSHOTS` times at most."""

    def __init__(self, frames: Iterable[Logged], facts: Facts, ended: str = "") -> None:
        """Raises ValueError where the `frames` do; `ended` says how the run of the log ended."""
        self.facts, self.watch = facts, FrameWatch(facts.catalogue, LOG_EVENTS)
        self.samples = Samples(_feed(facts))
        self.end_s = 0.0
        self._times, self._states = list[float](), list[dict[str, Any]]()
        self._every = SHORTEST_S
        self._take(frames)
        self._keep(self.end_s)
        if ended:
            self.watch.say(self.end_s, TEXT("event.run_ended", ended=ended))

    def _take(self, frames: Iterable[Logged]) -> None:
        origin: float | None = None
        for frame in frames:
            if frame.direction == NOTED:
                continue
            if origin is None:
                origin = frame.time_s if frame.time_s > CALENDAR_S else 0.0
            now = max(frame.time_s - origin, self.end_s)
            if not self._times or now - self._times[-1] >= self._every:
                self.watch.tick(now)
                self._keep(now)
            self.end_s = now
            good = self.watch.take(now, frame.id, frame.data)
            if good is not None:
                self.samples.add(now, good[0], self.watch.last)

    def _keep(self, now: float) -> None:
        """Keep the state at `now`; where there are too many, every second one is dropped."""
        self._times.append(now)
        self._states.append(self.watch.document())
        if len(self._times) > SNAPSHOTS:
            self._times, self._states, self._every = self._times[::2], self._states[::2], 2 * self._every

    def document(self, time_s: float) -> dict[str, Any]:
        """The last state kept before `time_s`."""
        k = max(int(np.searchsorted(self._times, time_s, "right")) - 1, 0)
        return {**self._states[k], "time_s": time_s, "trouble": ""}


def _feed(facts: Facts) -> LineFeed:
    panels = panels_of(facts.frame_map, facts.catalogue)
    return LineFeed([line for panel in panels for line in panel.lines], facts.catalogue)
