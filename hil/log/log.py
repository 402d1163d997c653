"""Logs of a node's frames: a BLF file written by a process of its own, and a record beside it of what ran."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import struct
import subprocess
import sys
from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Self

from hil.log.blf_file import LATEST_S, NOTED, RECEIVED, SENT, WITHHELD, BlfFile, Logged

ROOM: Final = 1 << 20
FORMAT: Final = 1
_F_SETPIPE_SZ: Final = 1031
_STOP_S: Final = 10.0


def record_path(path: Path) -> Path:
    """Where the record of the log `path` stands: beside it, ending in `.json`."""
    return path.with_suffix(".json")


def keep_older(path: Path) -> Path | None:
    """Move a log that stands at `path`, and its record, to the first free name `NAME-1.blf`, `NAME-2.blf`, ...; that
    name, None where there is no such log. Raises ValueError where it cannot be moved.
    """
    if not path.exists():
        return None
    number = 1
    while (kept := path.with_name(f"{path.stem}-{number}{path.suffix}")).exists() or record_path(kept).exists():
        number += 1
    try:
        path.rename(kept)
        if record_path(path).exists():
            record_path(path).rename(record_path(kept))
    except OSError as error:
        raise ValueError(f"{path}: older log must be one that can be moved; got: {error.strerror or error}") from None
    return kept


def write_record(path: Path, record: Mapping[str, Any]) -> None:
    """Write the record of the log `path`, complete or not at all. Raises ValueError for a path that is no BLF file or
    cannot be written.
    """
    if path.suffix != ".blf":
        raise ValueError(f"log must be a file name that ends in .blf; got {path}")
    target = record_path(path)
    temporary = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        temporary.write_text(
            json.dumps({"format": FORMAT, **record}, indent=2, sort_keys=True) + "\n", encoding="utf-8"
        )
        temporary.replace(target)
    except OSError as error:
        raise ValueError(f"{path}: log must be a file that can be written; got: {error.strerror or error}") from None


class NodeLog(ABC):
    """A log that a node writes its frames to; `dropped` counts those that could not be written. None of its methods but
    `close` raises or waits.
    """

    def __init__(self, path: Path, record: Mapping[str, Any]) -> None:
        """Begin the log `path` (.blf) with its `record`. Raises ValueError where they cannot be written."""
        write_record(path, record)
        self._record = dict(record)
        self.path, self.dropped, self.written = path, 0, 0

    def add_to_record(self, more: Mapping[str, Any]) -> None:
        """Write the record anew, with what was known only once the run was over. Raises ValueError as the
        constructor.
        """
        self._record |= more
        write_record(self.path, self._record)

    def received(self, time_s: float, identifier: int, data: bytes | bytearray) -> None:
        """Note a frame that came in at `time_s` of the node's clock."""
        self._put(time_s, identifier, data, RECEIVED)

    def sent(self, time_s: float, identifier: int, data: bytes | bytearray, withheld: bool = False) -> None:
        """Note a frame that the tick at `time_s` sent, or only computed (`withheld`)."""
        self._put(time_s, identifier, data, WITHHELD if withheld else SENT)

    def noted(self, time_s: float, code: int, value: float = 0.0) -> None:
        """Note something that is no frame (codes: `hil.log.recorder`)."""
        self._put(time_s, code, struct.pack("<d", value), NOTED)

    def _put(self, time_s: float, identifier: int, data: bytes | bytearray, way: int) -> None:
        if not 0 <= time_s <= LATEST_S or len(data) > 8:
            self.dropped += 1
        elif self._write(Logged(round(time_s * 1e9), identifier, bytes(data), way)):
            self.written += 1
        else:
            self.dropped += 1

    @abstractmethod
    def _write(self, frame: Logged) -> bool:
        """Write one frame; whether it was taken."""

    @abstractmethod
    def close(self) -> None:
        """End the log."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class FrameLog(NodeLog):
    """A log that a process of its own writes: the node only hands frames to a pipe, which takes a microsecond and never
    waits.

    The writer puts whole containers on file at least twice a second and, once the node is gone, by whatever means, what
    is left in the pipe: a killed node loses nothing, a killed writer at most the last second. Where the pipe (1 MiB,
    43,690 frames) is full or the writer is gone, frames are dropped and counted in `dropped`.
    """

    def __init__(self, path: Path, record: Mapping[str, Any]) -> None:
        """Begin the log. Errors as `NodeLog`."""
        super().__init__(path, record)
        with contextlib.closing(BlfFile(path).file):
            pass
        reading, self._pipe = os.pipe()
        with contextlib.suppress(OSError):
            fcntl.fcntl(self._pipe, _F_SETPIPE_SZ, ROOM)
        os.set_blocking(self._pipe, False)
        command = [sys.executable, "-m", "hil.log.writer_process", str(path.absolute())]
        self._writer = subprocess.Popen(
            command, stdin=reading, stdout=subprocess.DEVNULL, start_new_session=True, cwd=Path(__file__).parents[2]
        )
        os.close(reading)

    def _write(self, frame: Logged) -> bool:
        if self._pipe < 0:
            return False
        try:
            os.write(self._pipe, frame.packed())
        except OSError:
            return False
        return True

    def hasten(self, priority: int) -> None:
        """Give the writer SCHED_FIFO too: else, put aside while it holds the pipe, it holds up a node of higher
        priority. Raises OSError.
        """
        os.sched_setscheduler(self._writer.pid, os.SCHED_FIFO, os.sched_param(priority))

    def close(self) -> None:
        """End the log; waits until the writer has finished, at most 10 s."""
        if self._pipe < 0:
            return
        os.close(self._pipe)
        self._pipe = -1
        try:
            self._writer.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self._writer.kill()
            self._writer.wait()


class LockstepLog(NodeLog):
    """The same log written at once, in the node's own process: for simulated time, which waits."""

    def __init__(self, path: Path, record: Mapping[str, Any], flush_s: float = 1.0) -> None:
        """Begin the log; a container every `flush_s` of the node's clock. Errors as `NodeLog`."""
        super().__init__(path, record)
        self._file, self._flush_s, self._flushed_s = BlfFile(path), flush_s, 0.0

    def _write(self, frame: Logged) -> bool:
        self._file.write(frame)
        if frame.time_s - self._flushed_s >= self._flush_s:
            self._file.flush()
            self._flushed_s = frame.time_s
        return True

    def close(self) -> None:
        """End the log."""
        self._file.stop()
