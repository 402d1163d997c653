"""Reads CAN logs of any format that python-can reads, and the record beside a log of ours."""

from __future__ import annotations

import json
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import can

from hil.formats.channels import check_regular, library, refusing
from hil.formats.mf4_file import EXTRA, holds_frames
from hil.log.blf_file import Logged, is_own, way_of
from hil.log.log import record_path

ENDINGS: Final = (".blf", ".asc", ".mf4", ".trc", ".log")
"""Vector's BLF and ASC, ASAM MF4 (with the package asammdf), PEAK's TRC, candump's log."""
LARGEST_FILE: Final = 1 << 31


def is_log(path: Path) -> bool:
    """Whether the file's name is that of a CAN log; an MF4 file may also be one of channels."""
    if path.suffix.lower() != ".mf4":
        return path.suffix.lower() in ENDINGS
    check_regular(path)
    return path.stat().st_size > 0 and holds_frames(path)


def read_frames(path: Path) -> Iterator[Logged]:
    """The classic data frames with 11-bit identifiers of the log `path`, in its order; others are left out. Times of a
    log of ours are its node's clock's, of others what they say.

    A file that ends in the middle gives what is whole. Raises ValueError of one sentence for what is no log.
    """
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ValueError(f"{path}: log must be smaller than {LARGEST_FILE} bytes; got {path.stat().st_size}")
        if path.stat().st_size == 0:
            raise ValueError(f"{path}: log must hold frames; got an empty file")
        if path.suffix.lower() == ".blf" and _first_bytes(path, 4) != b"LOGG":
            raise ValueError(f"{path}: log must be one in the format that its name ends in; got another content")
        if path.suffix.lower() == ".mf4" and not is_log(path):
            raise ValueError(f"{path}: log must hold frames of a CAN bus; got an MF4 file without any")
        if path.suffix.lower() == ".mf4":
            with refusing(path, "a log"):
                library("asammdf", EXTRA)
        reader: Any = can.LogReader(path)
        if path.suffix.lower() == ".blf" and is_own(_first_bytes(path, 64)):
            reader.start_timestamp = 0.0
    except OSError as error:
        raise ValueError(f"{path}: log must be a file that can be read; got: {error.strerror or error}") from None
    except Exception as error:
        if str(error).startswith(str(path)):
            raise
        raise ValueError(f"{path}: log must be one in the format that its name ends in; got: {_words(error)}") from None
    with reader:
        yield from _frames(reader, path)


def _first_bytes(path: Path, count: int) -> bytes:
    with path.open("rb") as file:
        return file.read(count)


def _frames(reader: Any, path: Path) -> Iterator[Logged]:
    messages, count = iter(reader), 0
    while True:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                message = next(messages)
        except StopIteration:
            return
        except zlib.error as error:
            raise ValueError(f"{path}: log must be undamaged; got after {count} frames: {_words(error)}") from None
        except Exception as error:  # noqa: BLE001 - libraries raise whatever they like at a damaged file
            if count and path.suffix.lower() == ".blf":
                return
            raise ValueError(f"{path}: log must be whole; got after {count} frames: {_words(error)}") from None
        count += 1
        if not (message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd):
            yield Logged(round(message.timestamp * 1e9), message.arbitration_id, bytes(message.data), way_of(message))


def read_log_record(path: Path) -> dict[str, Any]:
    """The record beside the log `path`. Raises ValueError of one sentence where there is none."""
    beside = record_path(path)
    try:
        found = json.loads(beside.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{beside}: record of the log must be there; got: {error.strerror or error}") from None
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise ValueError(f"{beside}: record of the log must be JSON; got: {_words(error)}") from None
    if not isinstance(found, dict):
        raise ValueError(f"{beside}: record of the log must be a JSON object; got a {type(found).__name__}")
    return found


def _words(error: BaseException) -> str:
    return " ".join(str(error).split())[:160] or type(error).__name__
