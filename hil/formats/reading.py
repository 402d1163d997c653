"""Channels of a file, read in a process of its own: a library that crashes or hangs takes nothing with it."""

import json
import subprocess
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Final

import numpy as np

from hil.formats.channels import Array, Channel, Heading, Pick, check_size, refusing
from hil.formats.ros_bag import is_bag
from hil.formats.table import FORMATS, Format, format_of
from hil.own_process import own_environment, own_module
from models.files.source import check_source

LONGEST_S: Final = 900.0  # that a reader may run
_LONGEST_LINE: Final = 1 << 26  # bytes that it may say at once


def read_channels(path: Path, pick: Pick) -> list[Channel]:
    """The channels of a file of a format of the table that `pick` takes. Raises ValueError of one sentence."""
    found = format_of(path)
    if found is None:
        raise ValueError(f"{path}: file must end in {', '.join(e for f in FORMATS for e in f.endings)}")
    if not is_bag(path):
        check_source(path, "record")
    wanted = f"a whole {found.name} file"
    with reading_process("hil.formats.reader_process", path) as reader, refusing(path, wanted):
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
