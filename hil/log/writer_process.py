"""The process that writes a log: entries from standard input to a BLF file and an MCAP file beside it."""

import contextlib
import os
import select
import signal
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from hil.log.blf_file import LOST, NOTED, PACKED, BlfFile, Logged, unpacked

if TYPE_CHECKING:
    from hil.log.mcap_log import McapLog

FLUSH_S: Final = 0.4  # after which a container is written though it is not full
TROUBLE: Final = "trouble: "  # begins a line on standard output that reports a failure
_BLOCK: Final = PACKED.size * 2048  # bytes read at once


def write_until_end(
    source: int,
    path: Path,
    *,
    calendar_s: float = 0.0,
    append: bool = False,
    mcap: Path | None = None,
    written: Callable[[int], object] = lambda count: None,
) -> int:
    """Write the entries from `source` to `path`, on file every `FLUSH_S`, and return their number; `written` gets it
    each time. With `append` the file is continued after a note that frames are missing. `mcap` gets the good frames.
    Raises OSError if the disk does not take them.
    """
    file, rest, count = BlfFile(path, calendar_s, append=append), b"", 0
    beside = None if mcap is None else _Beside(mcap)
    written(count)
    due = time.monotonic() + FLUSH_S
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
                if beside is not None:
                    beside.write(frame)
        if time.monotonic() >= due:
            file.flush()
            written(count)
            due = time.monotonic() + FLUSH_S
    file.flush()
    file.stop()
    if beside is not None:
        beside.close()
    written(count)
    return count


class _Beside:
    """An MCAP file beside the log: a failure is reported and ends it, but not the log."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: McapLog | None = None
        self._doing(self._begin)

    def _begin(self) -> None:
        from hil.log.mcap_log import McapLog

        self._file = McapLog(self._path)

    def write(self, frame: Logged) -> None:
        if self._file is not None:
            self._doing(partial(self._file.write, frame))

    def close(self) -> None:
        if self._file is not None:
            self._doing(self._file.close)

    def _doing(self, work: Callable[[], None]) -> None:
        try:
            work()
        except (OSError, ValueError) as error:
            self._file = None
            words = error.strerror if isinstance(error, OSError) and error.strerror else " ".join(str(error).split())
            with contextlib.suppress(OSError):
                print(f"{TROUBLE}{self._path}: MCAP file is not whole: {words}", flush=True)


def main() -> int:
    """`PATH CALENDAR_S MCAP [append]`; writes the number of frames on file, or what is wrong, to standard output."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    os.nice(5)
    path, calendar_s, append = Path(sys.argv[1]), float(sys.argv[2]), sys.argv[4:] == ["append"]
    mcap = Path(sys.argv[3]) if sys.argv[3] else None

    def written(count: int) -> None:
        with contextlib.suppress(OSError):
            print(count, flush=True)

    try:
        write_until_end(sys.stdin.fileno(), path, calendar_s=calendar_s, append=append, mcap=mcap, written=written)
    except OSError as error:
        print(error.strerror or error, flush=True)
        os._exit(1)
    return 0


if __name__ == "__main__":
    sys.exit(main())
