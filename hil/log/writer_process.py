"""The process that writes a log: frames from standard input to a BLF file until the input ends."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from hil.log.blf_file import LOST, NOTED, PACKED, BlfFile, Logged, unpacked

FLUSH_S: Final = 0.4
_BLOCK: Final = PACKED.size * 2048


def write_until_end(
    source: int,
    path: Path,
    flush_s: float = FLUSH_S,
    *,
    calendar_s: float = 0.0,
    append: bool = False,
    told: Callable[[int], object] = lambda count: None,
) -> int:
    """Write the frames that come from the file descriptor `source` to `path`, on file every `flush_s`. `told` gets how
    many are, at the begin and after each time; the whole number is returned. With `append` it goes on with the file,
    after a note that frames are missing. Raises OSError where the disk does not take them.
    """
    file, rest, count = BlfFile(path, calendar_s, append=append), b"", 0
    told(count)
    due = time.monotonic() + flush_s
    while True:
        ready, _, _ = select.select([source], [], [], max(due - time.monotonic(), 0.0))
        if ready:
            block = os.read(source, _BLOCK)
            if not block:
                break
            block = rest + block
            whole = len(block) - len(block) % PACKED.size
            rest = block[whole:]
            for frame in unpacked(block[:whole]):
                if append and not count:
                    file.write(Logged(frame.time_ns, LOST, bytes(8), NOTED))
                file.write(frame)
                count += 1
        if time.monotonic() >= due:
            file.flush()
            told(count)
            due = time.monotonic() + flush_s
    file.flush()
    file.stop()
    told(count)
    return count


def main() -> int:
    """`PATH CALENDAR_S [append]`; says on standard output how many frames are on file, or what is wrong with it."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    os.nice(5)
    path, calendar_s, append = Path(sys.argv[1]), float(sys.argv[2]), sys.argv[3:] == ["append"]

    def told(count: int) -> None:
        with contextlib.suppress(OSError):
            print(count, flush=True)

    try:
        write_until_end(sys.stdin.fileno(), path, calendar_s=calendar_s, append=append, told=told)
    except OSError as error:
        print(error.strerror or error, flush=True)
        os._exit(1)
    return 0


if __name__ == "__main__":
    sys.exit(main())
