"""The wall-clock guard of a run in simulated time: one that does not come to its end is failed."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

_AGAIN_S: Final = 1.0


@contextmanager
def at_most(longest_s: float, sentence: str) -> Iterator[Callable[[], None]]:
    """Fail what runs within it with ValueError(`sentence`) after `longest_s` s of wall clock: by a timer, within a call
    that does not return too, where this is the main thread; else where the function that it gives is called, as between
    two ticks.
    """
    end = time.monotonic() + longest_s

    def look() -> None:
        if time.monotonic() >= end:
            raise ValueError(sentence)

    def ring(_: int, __: FrameType | None) -> None:
        look()

    if threading.current_thread() is not threading.main_thread():
        yield look
        return
    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, longest_s, _AGAIN_S)
    try:
        yield look
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
