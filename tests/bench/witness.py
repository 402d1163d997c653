"""When this machine was away: a process on each core that only sleeps, and before everything else, so that what makes
it late lies below the machine (or in a kernel that does not let it in).
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import IO, Final, NamedTuple

PERIOD_NS: Final = 1_000_000
TOLD_NS: Final = 500_000
_PRIORITY: Final = 99
_CODE: Final = f"""
import gc, os, sys, time
os.sched_setaffinity(0, {{int(sys.argv[1])}})
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param({_PRIORITY}))
except OSError:
    print("ordinary", file=sys.stderr, flush=True)
else:
    print("first", file=sys.stderr, flush=True)
gc.freeze()
parent = os.getppid()
due = time.monotonic_ns()
while os.getppid() == parent:
    due += {PERIOD_NS}
    left = due - time.monotonic_ns()
    if left > 0:
        time.sleep(left / 1e9)
    woke = time.monotonic_ns()
    if woke - due > {TOLD_NS}:
        print(due - {PERIOD_NS}, woke, flush=True)
        due = woke
"""


class Away(NamedTuple):
    """A time in which a core did not let its witness wake: from the last time it was seen to the next, ns of the
    monotonic clock.
    """

    begin_ns: int
    end_ns: int

    @property
    def ms(self) -> float:
        """How long, less the sleep that was asked for."""
        return max(self.end_ns - self.begin_ns - PERIOD_NS, 0) / 1e6


class Witnesses:
    """What the cores' witnesses have seen; complete once their block has ended. `first` says whether the system let
    them go first: else they may have waited for this machine's own work.
    """

    def __init__(self) -> None:
        self.first = True
        self.cores, self.stood_s = len(os.sched_getaffinity(0)), 0.0
        self.away: list[Away] = []

    def longest(self, begin_ns: int, end_ns: int) -> float:
        """The longest time away that overlaps the span, in ms; 0 where there is none."""
        return max((a.ms for a in self.away if a.begin_ns <= end_ns and a.end_ns >= begin_ns), default=0.0)


@contextmanager
def witnesses() -> Iterator[Witnesses]:
    """Let one stand on each core for the time of the block."""
    seen = Witnesses()
    with ExitStack() as stack:
        standing = [_standing(core, stack) for core in sorted(os.sched_getaffinity(0))]
        try:
            for child, _ in standing:
                assert child.stderr is not None
                seen.first &= child.stderr.readline() == "first\n"
            began = time.monotonic()
            yield seen
            seen.stood_s = time.monotonic() - began
        finally:
            for child, file in standing:
                child.kill()
                child.communicate()
                file.seek(0)
                words = [line.split() for line in file if line.endswith("\n")]
                seen.away += [Away(int(begin), int(end)) for begin, end in words]


def _standing(core: int, stack: ExitStack) -> tuple[subprocess.Popen[str], IO[str]]:
    file = tempfile.TemporaryFile("w+")  # noqa: SIM115 - the stack closes it
    stack.enter_context(file)
    child = subprocess.Popen([sys.executable, "-c", _CODE, str(core)], stdout=file, stderr=subprocess.PIPE, text=True)
    return child, file
