"""The process that identifies beside a run. Where it dies, one lesson fails and the run goes on."""

import contextlib
import os
import signal
import time
from concurrent.futures import Future, ThreadPoolExecutor
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Final, Self

from hil.app.learn.identify import TEXT, LearningAnswer, LearningQuestion, answer
from hil.own_process import error_text
from models.theta import Theta
from models.workers import end_with_parent

NICE: Final = 19  # the lowest priority
READY_S: Final = 60.0  # Longest wait for its start before the first tick
CLOSED_S: Final = 2.0  # Longest wait for the end of a process that has been killed
_SPAWN: Final = get_context("spawn")


class Background:
    """A process of lowest priority that identifies, one question at a time, on all cores but the first. Only a thread
    waits for it; `begin` starts the thread before the controller takes its core and priority. A future never raises:
    where the process dies or cannot start, the answer says so.
    """

    def __init__(self) -> None:
        assert "process.not_started" in TEXT  # read while files can be opened, so that no answer raises
        self._keeper = ThreadPoolExecutor(1, "learner")
        self._process: SpawnProcess | None = None
        self._pipe: Connection | None = None
        self._closed = False

    def begin(self) -> None:
        self._keeper.submit(self._start).exception()

    def __call__(self, question: LearningQuestion) -> Future[LearningAnswer]:
        return self._keeper.submit(self._ask, question)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Kill the process within `CLOSED_S`, also one that is stopped; a pending answer is dropped."""
        self._closed = True
        self._keeper.shutdown(wait=False, cancel_futures=True)
        if (process := self._process) is not None:
            process.kill()
            _status(process, CLOSED_S)

    def _start(self) -> Connection:
        """Start a process and wait until it is ready. Raises OSError or EOFError."""
        ours, theirs = _SPAWN.Pipe()
        with theirs:
            self._process = _SPAWN.Process(target=_work, args=(theirs,), daemon=True)
            self._process.start()
        self._pipe = ours
        if self._closed:
            self._process.kill()
        if not ours.poll(READY_S):
            raise TimeoutError(f"not ready within {READY_S:g} s")
        ours.recv()
        return ours

    def _ask(self, question: LearningQuestion) -> LearningAnswer:
        try:
            pipe = self._pipe if self._process is not None and self._process.is_alive() else None
            if pipe is None:
                self._end()
                pipe = self._start()
        except Exception as error:  # noqa: BLE001 - an exhausted system may raise anything
            self._end()
            return _failed(TEXT("process.not_started", why=error_text(error)))
        try:
            pipe.send(question)
            found = pipe.recv()
            assert isinstance(found, LearningAnswer)
            return found
        except Exception as error:  # noqa: BLE001 - whatever a broken pipe holds
            # the kernel closes the pipe of a process that dies before it says how that ended
            ended = self._end(CLOSED_S if isinstance(error, EOFError | ConnectionError) else 0.0)
            return _failed(ended or TEXT("process.no_answer", why=error_text(error)))

    def _end(self, wait_s: float = 0.0) -> str:
        """Kill the process and close the pipe; how it had ended within `wait_s`, "" where it had not."""
        process, pipe, self._process, self._pipe = self._process, self._pipe, None, None
        ended = ""
        if process is not None and process.pid is not None:
            code = _status(process, wait_s)
            ended = "" if code is None else _end_words(code)
            process.kill()
            _status(process, CLOSED_S)
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()
        return ended


def _status(process: SpawnProcess, wait_s: float) -> int | None:
    """The exit status within `wait_s`; another waiting thread may have fetched it and not stored it yet."""
    end = time.monotonic() + wait_s
    while process.exitcode is None and (left := end - time.monotonic()) > 0:
        process.join(left)
    return process.exitcode


def _failed(sentence: str) -> LearningAnswer:
    return LearningAnswer(Theta(), (), "none", sentence, searched=False)


def _end_words(code: int) -> str:
    if code < 0:
        with contextlib.suppress(ValueError):
            return TEXT("process.killed", signal=signal.Signals(-code).name)
    return TEXT("process.ended", status=code)


def _work(pipe: Connection) -> None:
    """Answer with lowest priority, deaf to Ctrl-C, which asks the controller for a stop; end with the parent."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    end_with_parent()
    os.nice(NICE)
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    if len(cores) > 1:
        os.sched_setaffinity(0, cores[1:])
    pipe.send(None)
    with contextlib.suppress(EOFError, OSError):
        while True:
            pipe.send(answer(pipe.recv()))
