"""Channels of a file, read in a process of its own: a library that crashes or hangs takes nothing with it."""

import json
import os
import resource
import subprocess
import sys
import threading
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from hil.formats.channels import Array, Channel, Heading, Pick, check_size, refusing
from hil.formats.ros_bag import is_bag
from hil.formats.table import FORMATS, Format, format_of
from hil.own_process import own_environment, own_module
from models.files.access import check_source

LONGEST_S: Final = 900.0  # that a reader may run
_LONGEST_LINE: Final = 1 << 26  # bytes that it may say at once
MEMORY: Final = 7 << 27  # bytes that a reader may take
ADDRESSES: Final = 8 << 30
"""Most memory in bytes of the process's own (its code comes to it, which leaves it below 1 GB), and most addresses,
which libraries reserve without using them.
"""
SECONDS: Final = 600  # most time on a processor in s
UNPACKED: Final = 1 << 30  # most bytes of a file that the process may write: what a library unpacks beside the record
LEAST_S: Final = 10  # time on a processor that any file may take
SLOWEST: Final = 500_000  # bytes of a file for which it may take a second more


def read_channels(path: Path, pick: Pick) -> list[Channel]:
    """The channels of a file of a format of the table that `pick` takes. Raises ValueError of one sentence."""
    found = format_of(path)
    if found is None:
        raise ValueError(f"{path}: file must end in {', '.join(e for f in FORMATS for e in f.endings)}")
    if not is_bag(path):
        check_source(path, "record")
    wanted = f"a whole {found.name} file"
    with reading_process("hil.formats.reading", path) as reader, refusing(path, wanted):
        return _converse(path, found, reader, pick)


@contextmanager
def reading_process(module: str, path: Path) -> Iterator[subprocess.Popen[bytes]]:
    """The process in which `module` reads `path`; it is ended on leaving, and after `LONGEST_S`."""
    with subprocess.Popen(
        [*own_module(module), str(path.absolute())],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        cwd=Path(__file__).parents[2],
        env=own_environment(),
    ) as reader:
        late = threading.Timer(LONGEST_S, reader.kill)
        late.start()
        try:
            yield reader
        finally:
            late.cancel()
            reader.kill()


def _converse(path: Path, found: Format, reader: subprocess.Popen[bytes], pick: Pick) -> list[Channel]:
    """Ask the process for what `pick` takes and receive it."""
    told, asked = reader.stdout, reader.stdin
    assert told is not None
    assert asked is not None
    channels: list[Channel] = []
    while line := told.readline(_LONGEST_LINE):
        document: dict[str, Any] = json.loads(line)
        if "refused" in document:
            raise ValueError(document["refused"].replace(str(path.absolute()), str(path)))
        if "end" in document:
            return channels
        if "headings" in document:
            headings = [Heading(**heading) for heading in document["headings"]]
            asked.write(json.dumps(list(_chosen(headings, pick))).encode() + b"\n")
            asked.flush()
        else:
            values = _samples(told, document["samples"])
            times = _samples(told, document["samples"]) if document["clocked"] else None
            channels.append(Channel(Heading(**document["heading"]), values, times))
    ended = reader.wait()
    raise ValueError(
        f"{path}: file must be a whole {found.name} file; got one at which the reader ended"
        f" ({f'signal {-ended}' if ended < 0 else f'status {ended}'})"
    )


def _chosen(headings: Sequence[Heading], pick: Pick) -> list[str]:
    chosen = list(dict.fromkeys(pick(headings)))
    check_size({heading.name: heading.samples for heading in headings if heading.name in set(chosen)})
    return chosen


def _samples(told: IO[bytes], count: int) -> Array:
    return np.frombuffer(told.read(8 * count), dtype="<f8").astype(float)


def allowed_s(size: int) -> int:
    """Time on a processor in s that a file of `size` bytes may take."""
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
    """Headings, then samples of what `source` asks for, or a sentence: JSON, then numbers of 8 bytes."""

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
