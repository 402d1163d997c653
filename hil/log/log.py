"""Logs of a node's frames: a BLF file written by a process of its own, and a record beside it of what ran."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import subprocess
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

from hil.log.blf_file import LATEST_S, PACKED, RECEIVED, SENT, WITHHELD, BlfFile, Logged
from hil.log.writer_process import TROUBLE
from hil.own_process import own_environment, own_module

if TYPE_CHECKING:
    from hil.log.mcap_log import McapLog

ROOM: Final = 1 << 20
FORMAT: Final = 2
_F_SETPIPE_SZ: Final = 1031
_STOP_S: Final = 30.0
_AGAIN_S: Final = 1.0
_BEGINS_S = 10.0
_TOGETHER: Final = 4096 // PACKED.size
"""Frames that the pipe takes together or not at all."""
_MOST_NAMES: Final = 1000


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


def claim(path: Path) -> tuple[int, Path, Path | None]:
    """A log's file for this run alone: a lock on it (a file descriptor), its name, and the name of an older log that
    stood there (`keep_older`). Where another run is writing to `path` the name is `NAME-run2.blf`, `NAME-run3.blf`, ...
    Raises ValueError where there is none to be had.
    """
    kept: Path | None = None
    number, wanted = 1, path
    for _ in range(_MOST_NAMES):
        try:
            lock = os.open(wanted, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
            if _locked(lock, wanted):
                return lock, wanted, kept
            os.close(lock)
        except FileExistsError:
            lock = os.open(wanted, os.O_RDWR)
            if _locked(lock, wanted) and os.fstat(lock).st_size:
                kept = keep_older(wanted)
            else:
                number += 1
                wanted = path.with_name(f"{path.stem}-run{number}{path.suffix}")
            os.close(lock)
        except OSError as error:
            raise ValueError(
                f"{path}: log must be a file that can be written; got: {error.strerror or error}"
            ) from None
    raise ValueError(f"{path}: log must have a name that is free; got {_MOST_NAMES} that are not")


def _locked(lock: int, path: Path) -> bool:
    """Whether the open file is now this run's alone, and still the one at `path`."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return os.fstat(lock).st_ino == path.stat().st_ino
    except OSError:
        return False


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
    `close` raises or waits. `before_close` is called first when it ends.
    """

    def __init__(self, path: Path, record: Mapping[str, Any]) -> None:
        """Begin the log `path` (.blf) with its `record`. Raises ValueError where they cannot be written."""
        write_record(path, record)
        self._record = dict(record)
        self.path, self.dropped, self.written = path, 0, 0
        self.before_close: Callable[[], None] = lambda: None

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

    def put(self, frames: Sequence[Logged]) -> None:
        """Write frames together: all of them, or those at the end not."""
        taken = self._write(frames) if frames else 0
        self.written += taken
        self.dropped += len(frames) - taken

    def _put(self, time_s: float, identifier: int, data: bytes | bytearray, way: int) -> None:
        if not 0 <= time_s <= LATEST_S or len(data) > 8:
            self.dropped += 1
        else:
            self.put([Logged(round(time_s * 1e9), identifier, bytes(data), way)])

    @abstractmethod
    def _write(self, frames: Sequence[Logged]) -> int:
        """Write frames; how many were taken."""

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

    The log begins once its writer does, or after 10 s. The writer puts whole containers on file at least twice a
    second and, once the node is gone, by whatever means, what is left in the pipe: a killed node loses nothing, a
    killed writer at most the last second. A writer that dies, also of a full disk, is followed by another one, at once
    and then once a second; until then frames wait in the pipe (1 MiB, 43,690 frames), and what no longer fits is
    dropped. Each such thing is a sentence for `tell`, at once, and in `troubles`; once the log is closed, `lost` counts
    frames that were taken and never came on file.
    """

    def __init__(
        self,
        path: Path,
        record: Mapping[str, Any],
        tell: Callable[[str], object] = lambda sentence: None,
        mcap: Path | None = None,
    ) -> None:
        """Begin the log at `path`, or, where another run is writing there, at a name beside it (`claim`). The writer
        writes `mcap`, too, where it is asked for. Errors as `NodeLog`.
        """
        self._lock, path, self.kept = claim(path)
        self._calendar_s = time.time()
        super().__init__(path, {**record, "calendar_start_s": self._calendar_s})
        try:
            BlfFile(path, self._calendar_s).stop()
        except OSError as error:
            os.close(self._lock)
            raise ValueError(
                f"{path}: log must be a file that can be written; got: {error.strerror or error}"
            ) from None
        self._reading, self._pipe = os.pipe()
        with contextlib.suppress(OSError):
            fcntl.fcntl(self._pipe, _F_SETPIPE_SZ, ROOM)
        os.set_blocking(self._pipe, False)
        self.troubles: list[str] = []
        self.lost, self._mcap = 0, mcap
        self._tell, self._priority, self._on_file, self._closing = tell, 0, 0, threading.Event()
        self._begun = threading.Event()
        self._writer = self._begin()
        self._watch = threading.Thread(target=self._watched, daemon=True)
        self._watch.start()
        self._begun.wait(_BEGINS_S)

    def _begin(self, *how: str) -> subprocess.Popen[str]:
        beside = "" if self._mcap is None else str(_unused(self._mcap) if how else self._mcap.absolute())
        command = [*own_module("hil.log.writer_process"), str(self.path.absolute()), str(self._calendar_s), beside]
        writer = subprocess.Popen(
            [*command, *how],
            stdin=self._reading,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
            cwd=Path(__file__).parents[2],
            env=own_environment(),
        )
        if self._priority:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(writer.pid, os.SCHED_FIFO, os.sched_param(self._priority))
        return writer

    def _watched(self) -> None:
        """Follow the writer, and begin another one where it dies."""
        while True:
            before, word = self._on_file, ""
            assert self._writer.stdout is not None
            with self._writer.stdout as said:
                for line in said:
                    word = line.strip()
                    if word.startswith(TROUBLE):
                        self.troubles.append(word.removeprefix(TROUBLE))
                        self._tell(self.troubles[-1])
                        continue
                    self._on_file = before + int(word) if word.isdigit() else self._on_file
                    self._begun.set()
            status = self._writer.wait()
            if status == 0 or self._closing.is_set():
                return
            why = f"by signal {-status}" if status < 0 else word
            self.troubles.append(f"log {self.path}: its writer ended ({why}); frames are missing")
            self._tell(f"{self.troubles[-1]}; another one goes on")
            if status > 0 or len(self.troubles) > 1:
                self._closing.wait(_AGAIN_S)
            self._writer = self._begin("append")

    def _write(self, frames: Sequence[Logged]) -> int:
        if self._pipe < 0:
            return 0
        taken = 0
        for k in range(0, len(frames), _TOGETHER):
            some = frames[k : k + _TOGETHER]
            try:
                os.write(self._pipe, b"".join(frame.packed() for frame in some))
            except OSError:
                if not self.dropped:
                    self.troubles.append(f"log {self.path}: frames are dropped, its writer does not take them in time")
                    self._tell(self.troubles[-1])
                break
            taken += len(some)
        return taken

    def hasten(self, priority: int) -> None:
        """Give the writer SCHED_FIFO too: else, put aside while it holds the pipe, it holds up a node of higher
        priority. Raises OSError.
        """
        os.sched_setscheduler(self._writer.pid, os.SCHED_FIFO, os.sched_param(priority))
        self._priority = priority

    def close(self) -> None:
        """End the log; waits until the writer has finished, at most 30 s."""
        if self._pipe < 0:
            return
        self.before_close()
        os.close(self._pipe)
        self._pipe = -1
        self._watch.join(_STOP_S)
        self._closing.set()
        if self._watch.is_alive():
            self._writer.kill()
            self._watch.join()
        os.close(self._reading)
        os.close(self._lock)
        self.lost = max(self.written - self._on_file, 0)
        if self.lost:
            self.troubles.append(f"log {self.path}: {self.lost} frames that were handed to its writer are not on file")


def _unused(path: Path) -> Path:
    """A name beside `path` that no file has."""
    number = 2
    while (other := path.with_name(f"{path.stem}-{number}{path.suffix}")).exists():
        number += 1
    return other.absolute()


class LockstepLog(NodeLog):
    """The same log written at once, in the node's own process: for simulated time, which waits."""

    def __init__(
        self, path: Path, record: Mapping[str, Any], flush_s: float = 1.0, mcap: McapLog | None = None
    ) -> None:
        """Begin the log; a container every `flush_s` of the node's clock; frames go to `mcap`, too. Errors as
        `NodeLog`.
        """
        super().__init__(path, record)
        self._file, self._flush_s, self._flushed_s, self._mcap = BlfFile(path), flush_s, 0.0, mcap

    def _write(self, frames: Sequence[Logged]) -> int:
        for frame in frames:
            self._file.write(frame)
            if self._mcap is not None:
                self._mcap.write(frame)
        if frames[-1].time_s - self._flushed_s >= self._flush_s:
            self._file.flush()
            self._flushed_s = frames[-1].time_s
        return len(frames)

    def close(self) -> None:
        """End the log."""
        self.before_close()
        self._file.stop()
        if self._mcap is not None:
            self._mcap.close()
