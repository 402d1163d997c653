"""The process that writes a log: frames from standard input to a BLF file until the input ends."""

from __future__ import annotations

import os
import select
import signal
import sys
import time
from pathlib import Path
from typing import Final

from hil.log.blf_file import PACKED, BlfFile, unpacked

FLUSH_S: Final = 0.4
_BLOCK: Final = PACKED.size * 2048


def write_until_end(source: int, path: Path, flush_s: float = FLUSH_S) -> int:
    """Write the frames that come from the file descriptor `source` to `path`, on file every `flush_s`; their number."""
    file, rest, count = BlfFile(path), b"", 0
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
                file.write(frame)
                count += 1
        if time.monotonic() >= due:
            file.flush()
            due = time.monotonic() + flush_s
    file.flush()
    file.stop()
    return count


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    os.nice(5)
    write_until_end(sys.stdin.fileno(), Path(sys.argv[1]))
