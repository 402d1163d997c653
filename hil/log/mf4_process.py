"""The CAN frames of an MF4 file, read by python-can and asammdf in a process of its own: a damaged file takes nothing
with it. Frames come as `_FRAME` on its standard output, behind them a sentence where something is wrong.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Final

from hil.formats.channels import library, refusing
from hil.formats.mf4_file import EXTRA, check_within
from hil.formats.reader_process import confined
from hil.formats.reading import reading_process
from hil.log.blf_file import Logged
from hil.log.library_reader import library_frames

_FRAME: Final = struct.Struct("<qIBB8s")
"""Time in ns, identifier, which way, count of bytes, bytes."""
_END: Final = 0xFFFF_FFFF
"""Identifier of what stands behind the frames: its time is the length of the sentence below it."""


def read_mf4_frames(path: Path) -> Iterator[Logged]:
    """The classic data frames with 11-bit identifiers of the MF4 file `path`. Raises ValueError of one sentence."""
    with reading_process("hil.log.mf4_process", path) as reader:
        assert reader.stdout is not None
        yield from _received(path, reader.stdout)


def _received(path: Path, told: IO[bytes]) -> Iterator[Logged]:
    while len(data := told.read(_FRAME.size)) == _FRAME.size:
        time_ns, identifier, way, size, content = _FRAME.unpack(data)
        if identifier != _END:
            yield Logged(time_ns, identifier, content[:size], way)
        elif said := told.read(time_ns).decode():
            raise ValueError(f"{path}: {said}")
        else:
            return
    raise ValueError(f"{path}: log must be a whole MF4 file; got one at which the reader ended")


def tell_frames(path: Path, target: IO[bytes]) -> None:
    """Write the frames of `path` to `target`, and behind them what is wrong, or nothing."""
    said = ""
    try:
        with refusing(path, "a log"):
            library("asammdf", EXTRA)
            check_within(path)
        for frame in library_frames(path):
            target.write(_FRAME.pack(frame.time_ns, frame.id, frame.way, len(frame.data), frame.data))
    except ValueError as error:
        said = str(error).removeprefix(f"{path}: ")
    text = said.encode()
    target.write(_FRAME.pack(len(text), _END, 0, 0, b"") + text)
    target.flush()


if __name__ == "__main__":
    confined(tell_frames)
