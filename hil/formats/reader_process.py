"""The process that reads one file: what a damaged file does to a library ends here."""

import json
import os
import resource
import sys
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from hil.formats.channels import Channel, Heading, refusing
from hil.formats.table import format_of

MEMORY: Final = 7 << 27  # bytes that a reader may take
ADDRESSES: Final = 8 << 30
"""Most memory in bytes of the process's own (its code comes to it, which leaves it below 1 GB), and most addresses,
which libraries reserve without using them.
"""
SECONDS: Final = 600  # most time on a processor in s
UNPACKED: Final = 1 << 30  # most bytes of a file that the process may write: what a library unpacks beside the record
LEAST_S: Final = 10  # that a reader may run
SLOWEST: Final = 500_000
"""Time on a processor in s that any file may take, and bytes of a file for which it may take a second more."""


def allowed_s(size: int) -> int:
    return min(LEAST_S + size // SLOWEST, SECONDS)


def confined(task: Callable[[Path, IO[bytes]], None]) -> None:
    """Do `task` with the file that the command line names and standard output, within limits of memory and of processor
    time that go with its size. HDF5 loads no filters from a folder.
    """
    os.environ["HDF5_PLUGIN_PRELOAD"] = "::"
    path = Path(sys.argv[1])
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    longest = allowed_s(path.stat().st_size) if path.is_file() else SECONDS
    resource.setrlimit(resource.RLIMIT_CPU, (longest, longest))
    resource.setrlimit(resource.RLIMIT_FSIZE, (UNPACKED, UNPACKED))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with os.fdopen(os.dup(1), "wb") as told:
        os.dup2(2, 1)
        task(path, told)


def read_for(path: Path, source: IO[bytes], target: IO[bytes]) -> None:
    """Headings go to `target`, then the samples of what is asked for through `source`, or a sentence: a line of JSON
    each, samples as numbers of 8 bytes below it.
    """

    def pick(headings: Sequence[Heading]) -> Collection[str]:
        _tell(target, {"headings": [asdict(heading) for heading in headings]})
        return list(json.loads(source.readline() or "[]"))

    found = format_of(path)
    if found is None:
        return
    try:
        with refusing(path, f"a whole {found.name} file"):
            channels = found.read(path, pick)
    except ValueError as error:
        _tell(target, {"refused": str(error)})
        return
    for channel in channels:
        _send(target, channel)
    _tell(target, {"end": len(channels)})


def _send(target: IO[bytes], channel: Channel) -> None:
    clocked = channel.time_s is not None
    _tell(target, {"heading": asdict(channel.heading), "samples": len(channel.values), "clocked": clocked})
    for values in (channel.values, channel.time_s):
        if values is not None:
            target.write(np.ascontiguousarray(values, dtype="<f8").tobytes())


def _tell(target: IO[bytes], document: Any) -> None:
    target.write(json.dumps(document).encode() + b"\n")
    target.flush()


if __name__ == "__main__":
    confined(lambda path, told: read_for(path, sys.stdin.buffer, told))
