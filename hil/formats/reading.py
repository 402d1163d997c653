"""Formats of other programs' files, and their reading in a separate process, where a library may crash or hang."""

import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from hil.formats import matlab_file, mcap_file, mf4_file, parquet_file, ros_bag, tdms_file
from hil.formats.channels import Array, Channel, Heading, Pick, Read, check_size, refusing
from hil.formats.ros_bag import is_bag
from hil.own_process import own_environment, own_module
from models.files.access import check_source, opened

Write = Callable[[Path, Sequence[Channel]], None]


@dataclass(frozen=True)
class Format:
    """A kind of file: its endings, the extra with its library, its reader and its writer."""

    name: str
    endings: tuple[str, ...]
    extra: str
    read: Read
    write: Write | None = None


FORMATS: Final = (
    Format("Parquet", (".parquet",), parquet_file.EXTRA, parquet_file.read, parquet_file.write),
    Format("MF4", (".mf4", ".mdf", ".dat"), mf4_file.EXTRA, mf4_file.read, mf4_file.write),
    Format("MCAP", (".mcap",), mcap_file.EXTRA, mcap_file.read, mcap_file.write),
    Format("ROS bag", (".db3", ".bag"), ros_bag.EXTRA, ros_bag.read),
    Format("TDMS", (".tdms",), tdms_file.EXTRA, tdms_file.read),
    Format("MATLAB or HDF5", (".mat", ".h5", ".hdf5"), matlab_file.EXTRA, matlab_file.read),
)

LOGS: Final = (".blf", ".asc", ".mf4", ".trc", ".log")
"""Vector's BLF and ASC, ASAM MF4 (with the package asammdf), PEAK's TRC, candump's log."""

_MF4_BEGINS: Final = (b"MDF", b"UnF")  # of a whole MF4 file and of one that was not closed; any other `.dat` is text
WRITTEN: Final = tuple(one.endings[0] for one in FORMATS if one.write)  # endings of files that can be written


def is_log(path: Path) -> bool:
    """Whether the file is a CAN log, by its name; an MF4 file, which may be one of channels, by its content."""
    if path.suffix.lower() != ".mf4":
        return path.suffix.lower() in LOGS
    return check_source(path, "record") > 0 and mf4_file.holds_frames(path)


def format_of(path: Path) -> Format | None:
    """The format of a file by its ending, or of a folder that is a bag; None for others and for a `.dat` of text."""
    ending = ".db3" if ros_bag.is_bag(path) else path.suffix.lower()
    if ending == ".dat":
        with suppress(ValueError, OSError), opened(path, "record") as file:
            if file.read(3) not in _MF4_BEGINS:
                return None
    return next((one for one in FORMATS if ending in one.endings), None)


def write_channels(path: Path, channels: Sequence[Channel]) -> bytes:
    """The content of a file `path` of a format that can be written. Raises ValueError of one sentence."""
    found = format_of(path)
    if found is None or found.write is None:
        raise ValueError(f"{path}: file must end in {', '.join(WRITTEN)}")
    with refusing(path, f"one that can be written as {found.name}"), tempfile.TemporaryDirectory() as folder:
        within = Path(folder) / f"file{path.suffix.lower()}"
        found.write(within, channels)
        return within.read_bytes()


# limits of a reader's process
LONGEST_S: Final = 900.0  # running time
_LONGEST_LINE: Final = 1 << 26  # bytes of a line that it sends
MEMORY: Final = 7 << 27  # bytes of data; with its code it stays below 1 GB
ADDRESSES: Final = 8 << 30  # bytes of address space, of which libraries reserve more than they use
SECONDS: Final = 600  # processor time
UNPACKED: Final = 1 << 30  # bytes of a file that it writes: what a library unpacks
LEAST_S: Final = 10  # processor time for a file of any size
SLOWEST: Final = 500_000  # bytes of a file per further second of processor time


def read_channels(path: Path, pick: Pick) -> list[Channel]:
    """The channels that `pick` takes of a file of one of the `FORMATS`. Raises ValueError of one sentence."""
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
    """The process in which `module` reads `path`; it is killed at the end, and after `LONGEST_S`."""
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
    """Request the channels that `pick` takes from the process, and receive them."""
    source, target = reader.stdout, reader.stdin
    assert source is not None
    assert target is not None
    channels: list[Channel] = []
    while line := source.readline(_LONGEST_LINE):
        document: dict[str, Any] = json.loads(line)
        if "refused" in document:
            raise ValueError(document["refused"].replace(str(path.absolute()), str(path)))
        if "end" in document:
            return channels
        if "headings" in document:
            headings = [Heading(**heading) for heading in document["headings"]]
            chosen = dict.fromkeys(pick(headings))
            check_size({heading.name: heading.samples for heading in headings if heading.name in chosen})
            _send(target, list(chosen))
        else:
            values = _samples(source, document["samples"])
            times = _samples(source, document["samples"]) if document["clocked"] else None
            channels.append(Channel(Heading(**document["heading"]), values, times))
    ended = reader.wait()
    how = f"signal {-ended}" if ended < 0 else f"status {ended}"
    raise ValueError(f"{path}: file must be a whole {found.name} file; got one at which the reader ended ({how})")


def _samples(source: IO[bytes], count: int) -> Array:
    return np.frombuffer(source.read(8 * count), dtype="<f8").astype(float)


def allowed_s(size: int) -> int:
    """Processor time in s that a file of `size` bytes may take."""
    return min(LEAST_S + size // SLOWEST, SECONDS)


def confined(task: Callable[[Path, IO[bytes]], None]) -> None:
    """Do `task` with the file on the command line and standard output, within limits of memory and processor time. HDF5
    loads no filters from a folder.
    """
    os.environ["HDF5_PLUGIN_PRELOAD"] = "::"
    path = Path(sys.argv[1])
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    longest = allowed_s(path.stat().st_size) if path.is_file() else SECONDS
    resource.setrlimit(resource.RLIMIT_CPU, (longest, longest))
    resource.setrlimit(resource.RLIMIT_FSIZE, (UNPACKED, UNPACKED))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with os.fdopen(os.dup(1), "wb") as target:
        os.dup2(2, 1)
        task(path, target)


def read_for(path: Path, source: IO[bytes], target: IO[bytes]) -> None:
    """Send headings, then the channels that `source` asks for, or a sentence: as JSON, samples as 8-byte numbers."""

    def pick(headings: Sequence[Heading]) -> Collection[str]:
        _send(target, {"headings": [asdict(heading) for heading in headings]})
        return list(json.loads(source.readline() or "[]"))

    found = format_of(path)
    if found is None:
        return
    try:
        with refusing(path, f"a whole {found.name} file"):
            channels = found.read(path, pick)
    except ValueError as error:
        _send(target, {"refused": str(error)})
        return
    for channel in channels:
        clocked = channel.time_s is not None
        _send(target, {"heading": asdict(channel.heading), "samples": len(channel.values), "clocked": clocked})
        for values in (channel.values, channel.time_s):
            if values is not None:
                target.write(np.ascontiguousarray(values, dtype="<f8").tobytes())
    _send(target, {"end": len(channels)})


def _send(target: IO[bytes], document: Any) -> None:
    target.write(json.dumps(document).encode() + b"\n")
    target.flush()


if __name__ == "__main__":
    confined(lambda path, target: read_for(path, sys.stdin.buffer, target))
