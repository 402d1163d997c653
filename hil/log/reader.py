"""Reads CAN logs of any format that python-can reads, and the record beside a log of ours."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from hil.formats.mf4_file import holds_frames
from hil.log.blf_file import Logged
from hil.log.blf_reader import Tell, read_blf
from hil.log.mf4_process import library_frames, read_mf4_frames
from hil.log.place import record_path
from models.files.source import check_source, read_json

ENDINGS: Final = (".blf", ".asc", ".mf4", ".trc", ".log")
"""Vector's BLF and ASC, ASAM MF4 (with the package asammdf), PEAK's TRC, candump's log."""
LARGEST_RECORD: Final = 1 << 26  # bytes


def is_log(path: Path) -> bool:
    """Whether the file's name is that of a CAN log; an MF4 file may also be one of channels."""
    if path.suffix.lower() != ".mf4":
        return path.suffix.lower() in ENDINGS
    return check_source(path, "record") > 0 and holds_frames(path)


def read_frames(path: Path, tell: Tell | None = None) -> Iterator[Logged]:
    """The classic data frames with 11-bit identifiers of the log `path`, in its order. Times of a log of ours are its
    node's clock's. A BLF file that ends in the middle gives what is whole, and `tell` gets a sentence. Raises
    ValueError.
    """
    if check_source(path, "log") == 0:
        raise ValueError(f"{path}: log must hold frames; got an empty file")
    if path.suffix.lower() == ".blf":
        yield from read_blf(path, tell or (lambda _: None))
        return
    if path.suffix.lower() == ".mf4":
        if not is_log(path):
            raise ValueError(f"{path}: log must hold frames of a CAN bus; got an MF4 file without any")
        yield from read_mf4_frames(path)
        return
    yield from library_frames(path)


def read_log_record(path: Path) -> dict[str, Any]:
    """The record beside the log `path`. Raises ValueError of one sentence where there is none."""
    beside = record_path(path)
    if not beside.exists():
        raise ValueError(f"{beside}: record of the log must be there; got no such file")
    return read_json(beside, "record of the log", LARGEST_RECORD)
