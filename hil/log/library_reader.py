"""CAN frames by python-can's own readers."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can

from hil.log.blf_file import Logged, way_of


def library_frames(path: Path) -> Iterator[Logged]:
    """The classic data frames with 11-bit identifiers of a file that python-can reads by its ending, within this
    process. Raises ValueError of one sentence.
    """
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


def _words(error: BaseException) -> str:
    return " ".join(str(error).split())[:160] or type(error).__name__
