"""Logs of a node's frames: a BLF file written by a separate process, and a record of the run beside it."""

from __future__ import annotations

import contextlib
import fcntl
import os
import subprocess
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

from hil.log.blf_file import PACKED, BlfFile, Logged
from hil.log.place import cannot_write, check_regular, claim, free_name, missing, stands, write_record
from hil.log.writer_process import TROUBLE
from hil.own_process import own_environment, own_module

if TYPE_CHECKING:
    from hil.log.mcap_log import McapLog

ROOM: Final = 1 << 20  # bytes between node and writer
_F_SETPIPE_SZ: Final = 1031  # of fcntl(2)
_STOP_S: Final = 30.0  # in which a writer must end
_CONTAINER_S: Final = 1.0  # of the node's clock, in lockstep
_AGAIN_S: Final = 1.0  # before a writer that fails again is restarted
_BEGINS_S = 10.0  # in which a writer must begin
_TOGETHER: Final = 4096 // PACKED.size  # frames that the pipe takes all or none of


class NodeLog(ABC):
    """The log of a node's frames; `dropped` counts frames that were not taken. Only `close` may raise or wait; it first
    calls `before_close`.
    """

    def __init__(self, path: Path, record: Mapping[str, Any]) -> None:
        """Begin the log `path` (.blf) with its `record`. Raises ValueError if they cannot be written."""
        check_regular(path)
        write_record(path, record)
        self._record = dict(record)
        self.path, self.dropped, self.written = path, 0, 0
        self.before_close: Callable[[], None] = lambda: None

    def add_to_record(self, more: Mapping[str, Any]) -> None:
        """Write the record again with the results of the run. Raises ValueError."""
        self._record |= more
        write_record(self.path, self._record)

    def put(self, frames: Sequence[Logged]) -> None:
        """Write frames; those at the end may be dropped."""
        taken = self._write(frames) if frames else 0
        self.written += taken
        self.dropped += len(frames) - taken

    @abstractmethod
    def _write(self, frames: Sequence[Logged]) -> int:
        """Write frames; returns the number taken."""

    @abstractmethod
    def close(self) -> None:
        """End the log."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class FrameLog(NodeLog):
    """A log written by a separate process: the node puts frames into a pipe and never waits.

    Whole containers are on file at least twice a second: a killed node loses nothing, a killed writer at most the last
    second. A dead writer is replaced; until then frames wait in the pipe (1 MiB, 43,690 frames), and further ones are
    dropped. Each trouble is a sentence for `tell` and in `troubles`. After `close`, `lost` counts frames that were
    taken but are not on file.
    """

    def __init__(
        self,
        path: Path,
        record: Mapping[str, Any],
        tell: Callable[[str], object] = lambda sentence: None,
        mcap: Path | None = None,
    ) -> None:
        """Begin the log at `path`, or beside it if another run writes there (`claim`); and the file `mcap`."""
        self._lock, path, self.kept = claim(path)
        self._calendar_s = time.time()
        super().__init__(path, {**record, "calendar_start_s": self._calendar_s})
        try:
            BlfFile(path, self._calendar_s).stop()
        except OSError as error:
            os.close(self._lock)
            raise cannot_write(path, error) from None
        self._reading, self._pipe = os.pipe()
        with contextlib.suppress(OSError):
            fcntl.fcntl(self._pipe, _F_SETPIPE_SZ, ROOM)
        os.set_blocking(self._pipe, False)
        self.troubles: list[str] = []
        self.lost, self._mcap, self._taken = 0, mcap, False
        self._tell, self._priority, self._on_file, self._closing = tell, 0, 0, threading.Event()
        self._begun = threading.Event()
        self._writer = self._begin()
        self._watch = threading.Thread(target=self._watched, daemon=True)
        self._watch.start()
        self._begun.wait(_BEGINS_S)

    def _begin(self, *how: str) -> subprocess.Popen[str]:
        mcap = self._mcap if self._mcap is None or not how else free_name(self._mcap, "-{}", 2)
        beside = "" if mcap is None else str(mcap.absolute())
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
        """Follow the writer, and replace it if it dies."""
        for begun in count(1):
            before, word = self._on_file, ""
            assert self._writer.stdout is not None
            with self._writer.stdout as said:
                for line in said:
                    word = line.strip()
                    if word.startswith(TROUBLE):
                        self._trouble(word.removeprefix(TROUBLE))
                        continue
                    self._on_file = before + int(word) if word.isdigit() else self._on_file
                    self._begun.set()
                    if not self._taken and not stands(self._lock, self.path):
                        self._taken = True
                        self._tell(f"log {self.path}: its file was taken away; what follows is not kept")
            status = self._writer.wait()
            if status == 0 or self._closing.is_set():
                return
            why = f"by signal {-status}" if status < 0 else word
            self._trouble(f"log {self.path}: its writer ended ({why}); frames are missing", "; another one goes on")
            if status > 0 or begun > 1:
                self._closing.wait(_AGAIN_S)
            try:
                self._writer = self._begin("append")
            except OSError as error:
                self._trouble(f"log {self.path}: no writer can be begun: {error.strerror or error}")
                return

    def _trouble(self, sentence: str, more: str = "") -> None:
        if sentence not in self.troubles:
            self.troubles.append(sentence)
            self._tell(sentence + more)

    def _write(self, frames: Sequence[Logged]) -> int:
        if self._pipe < 0:
            return 0
        taken = 0
        for k in range(0, len(frames), _TOGETHER):
            some = frames[k : k + _TOGETHER]
            try:
                os.write(self._pipe, b"".join(frame.packed() for frame in some))
            except OSError:
                self._trouble(f"log {self.path}: frames are dropped, its writer does not take them in time")
                break
            taken += len(some)
        return taken

    def hasten(self, priority: int) -> None:
        """Give the writer SCHED_FIFO too: else it may block the pipe for a node of higher priority."""
        os.sched_setscheduler(self._writer.pid, os.SCHED_FIFO, os.sched_param(priority))
        self._priority = priority

    def close(self) -> None:
        """End the log; waits for the writer, at most 30 s."""
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
        self.lost = max(self.written - self._on_file, 0)
        if self.lost:
            self.troubles.append(f"log {self.path}: {self.lost} frames that were handed to its writer are not on file")
        if words := missing(self._lock, self.path):
            self.lost = self.written
            self.troubles.append(f"log {self.path}: {words}")
        else:
            try:
                self.add_to_record({"entries": self.written})
            except ValueError as error:
                self.troubles.append(str(error))
        os.close(self._lock)


class LockstepLog(NodeLog):
    """The same log written at once by the node's own process, for simulated time, which waits."""

    def __init__(self, path: Path, record: Mapping[str, Any], mcap: McapLog | None = None) -> None:
        """Begin the log; frames are also written to `mcap`."""
        super().__init__(path, record)
        self._file, self._flushed_s, self._mcap = BlfFile(path), 0.0, mcap

    def _write(self, frames: Sequence[Logged]) -> int:
        for frame in frames:
            self._file.write(frame)
            if self._mcap is not None:
                self._mcap.write(frame)
        if frames[-1].time_s - self._flushed_s >= _CONTAINER_S:
            self._file.flush()
            self._flushed_s = frames[-1].time_s
        return len(frames)

    def close(self) -> None:
        self.before_close()
        self._file.stop()
        if self._mcap is not None:
            self._mcap.close()
        self.add_to_record({"entries": self.written})
