"""What the system grants the program: standard streams, memory, open files. Loaded before anything that needs them."""

import contextlib
import errno
import io
import os
import resource
import select
import sys
from collections.abc import Sequence
from typing import Final, TextIO

INTERRUPTED: Final = 130  # exit status, as shells have it: 128 and SIGINT
INTERRUPTION: Final = "interrupted: no result was written"
UNWRITTEN = 1  # The status of a command that did its work but could not write its result to standard output


class _Patient(io.FileIO):
    """A descriptor to write to; `trouble` is why it accepts no more, and later writes are dropped."""

    def __init__(self, number: int) -> None:
        super().__init__(number, "w", closefd=False)
        self.trouble = ""

    def write(self, data: object, /) -> int:
        view = memoryview(data)  # type: ignore[arg-type]
        if self.trouble:
            return view.nbytes
        try:
            return os.write(self.fileno(), view)
        except BlockingIOError:
            select.select([], [self], [])
            return 0
        except OSError as error:
            self.trouble = error.strerror or str(error)
            return view.nbytes


class Streams:
    """Standard input, output and error that no command dies of, be they full, closed or read by nobody."""

    def __init__(self) -> None:
        for number, mode in ((0, os.O_RDONLY), (1, os.O_RDONLY), (2, os.O_WRONLY)):
            with contextlib.suppress(OSError):
                os.fstat(number)
                continue
            os.set_inheritable(os.open(os.devnull, mode), True)
        sys.stdin = sys.stdin or open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
        self._output, self._error = _Patient(1), _Patient(2)
        sys.stdout = self.stdout = _text(self._output, sys.stdout)
        sys.stderr = self.stderr = _text(self._error, sys.stderr)

    def status(self, status: int) -> int:
        """The exit status of a command that ended with `status`; an error sentence where its result was not written."""
        with contextlib.suppress(OSError, ValueError):
            self.stdout.flush()
        if self._output.trouble:
            print(f"capsule: standard output must take the result; got: {self._output.trouble}", file=sys.stderr)
            status = status or UNWRITTEN
        with contextlib.suppress(OSError, ValueError):
            self.stderr.flush()
        return status


def _text(raw: _Patient, before: TextIO | None) -> io.TextIOWrapper:
    encoding, errors = getattr(before, "encoding", None) or "utf-8", getattr(before, "errors", None) or "strict"
    by_line = getattr(before, "line_buffering", False) or getattr(before, "write_through", False)
    return io.TextIOWrapper(io.BufferedWriter(raw), encoding, errors, line_buffering=by_line)


LEAST_MEMORY: Final = 1 << 30
"""Bytes of address space; with less, libraries fail while they are loaded, some of them silently."""
LEAST_FILES: Final = 32  # open files that the program needs
_ENDLESS: Final = 1 << 62  # bytes: a limit beyond is none
_MANY: Final = (errno.EMFILE, errno.ENFILE)
_FULL: Final = ("failed to map segment", "annot allocate memory", "Could not find/load shared object")
"""How loaders and libraries report that there is no memory for a library."""


def too_little(arguments: Sequence[str]) -> str:
    """Why a command cannot start, "" where it can; help needs nothing."""
    if not arguments or {"--help", "--version"} & set(arguments):
        return ""
    memory, files = _limit(resource.RLIMIT_AS), _limit(resource.RLIMIT_NOFILE)
    if memory < LEAST_MEMORY:
        return f"memory must be at least {LEAST_MEMORY >> 10} kB (ulimit -v); got a limit of {memory >> 10} kB"
    if files < LEAST_FILES:
        return f"open files must be at least {LEAST_FILES} (ulimit -n); got a limit of {files}"
    return ""


def shortage(error: BaseException) -> str:
    """Which resource `error` says is exhausted, else ""."""
    number, words = getattr(error, "errno", None), str(error)
    if number in _MANY or "Too many open files" in words:
        return f"open files must be enough for the command (ulimit -n); got a limit of {_limit(resource.RLIMIT_NOFILE)}"
    if number == errno.ENOMEM or isinstance(error, MemoryError) or any(part in words for part in _FULL):
        limit = _limit(resource.RLIMIT_AS)
        got = f"a limit of {limit >> 10} kB (ulimit -v)" if limit < _ENDLESS else "no more of the machine's"
        return f"memory must be enough for the command; got {got}"
    return ""


def _limit(what: int) -> int:
    soft = resource.getrlimit(what)[0]
    return _ENDLESS if soft == resource.RLIM_INFINITY else soft
