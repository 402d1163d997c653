"""Reads CAN logs of any format that python-can reads, and the record beside a log of ours."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import can

from hil.formats.channels import library, refusing
from hil.formats.mf4_file import EXTRA, holds_frames
from hil.log.blf_file import Logged, way_of
from hil.log.blf_reader import Tell, read_blf
from hil.log.log import record_path
from models.files.source import check_source, read_json

ENDINGS: Final = (".blf", ".asc", ".mf4", ".trc", ".log")
"""Vector's BLF and ASC, ASAM MF4 (with the package asammdf), PEAK's TRC, candump's log."""
LARGEST_RECORD: Final = 1 << 26


def is_log(path: Path) -> bool:
    """Whether the file's name is that of a CAN log; an MF4 file may also be one of channels."""
    if path.suffix.lower() != ".mf4":
        return path.suffix.lower() in ENDINGS
    return check_source(path, "record") > 0 and holds_frames(path)


def read_frames(path: Path, tell: Tell | None = None) -> Iterator[Logged]:
    """The classic data frames with 11-bit identifiers of the log `path`, in its order; others are left out. Times of a
    log of ours are its node's clock's, of others what they say.

    A BLF file that ends in the middle gives what is whole, and `tell` gets a sentence that says so. Raises ValueError
    of one sentence for what is no log.
    """
    if check_source(path, "log") == 0:
        raise ValueError(f"{path}: log must hold frames; got an empty file")
    if path.suffix.lower() == ".blf":
        yield from read_blf(path, tell or (lambda _: None))
        return
    if path.suffix.lower() == ".mf4":
        if not is_log(path):
            raise ValueError(f"{path}: log must hold frames of a CAN bus; got an MF4 file without any")
        with refusing(path, "a log"):
            library("asammdf", EXTRA)
    try:
        reader: Any = can.LogReader(path)
    except Exception as error:  # noqa: BLE001 - libraries raise whatever they like at a damaged file
        raise ValueError(f"{path}: log must be one in the format that its name ends in; got: {_words(error)}") from None
    with reader:
        yield from _frames(reader, path)


def _frames(reader: Any, path: Path) -> Iterator[Logged]:
    messages, count = iter(reader), 0
    while True:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                message = next(messages)
            stamp = round(message.timestamp * 1e9)
        except StopIteration:
            return
        except Exception as error:  # noqa: BLE001 - libraries raise whatever they like at a damaged file
            raise ValueError(f"{path}: log must be whole; got after {count} frames: {_words(error)}") from None
        count += 1
        if not (message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd):
            yield Logged(stamp, message.arbitration_id, bytes(message.data), way_of(message))


def read_log_record(path: Path) -> dict[str, Any]:
    """The record beside the log `path`. Raises ValueError of one sentence where there is none."""
    beside = record_path(path)
    if not beside.exists():
        raise ValueError(f"{beside}: record of the log must be there; got no such file")
    return read_json(beside, "record of the log", LARGEST_RECORD)


def _words(error: BaseException) -> str:
    return " ".join(str(error).split())[:160] or type(error).__name__
