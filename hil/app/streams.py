"""Standard input, output and error that no command dies of: full, closed or read by nobody; loaded first."""

import contextlib
import io
import os
import select
import sys
from typing import TextIO

UNWRITTEN = 1
"""The status of a command that did what it was asked for and whose result standard output did not take."""


class _Patient(io.FileIO):
    """A descriptor to write to; `trouble` is why it took no more, and what is written after that goes nowhere."""

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
    """The standard streams from `begin` on; `lost` says why the result is not all written, "" where it is."""

    def __init__(self) -> None:
        for number, way in ((0, os.O_RDONLY), (1, os.O_RDONLY), (2, os.O_WRONLY)):
            with contextlib.suppress(OSError):
                os.fstat(number)
                continue
            os.set_inheritable(os.open(os.devnull, way), True)
        sys.stdin = sys.stdin or open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
        self._output, self._error = _Patient(1), _Patient(2)
        sys.stdout = self.stdout = _text(self._output, sys.stdout)
        sys.stderr = self.stderr = _text(self._error, sys.stderr)

    def status(self, status: int) -> int:
        """The status that a command ends with whose own is `status`; where its result was not written, a sentence."""
        with contextlib.suppress(OSError, ValueError):
            self.stdout.flush()
        if self._output.trouble:
            print(f"capsule: standard output must take the result; got: {self._output.trouble}", file=sys.stderr)
            status = status or UNWRITTEN
        with contextlib.suppress(OSError, ValueError):
            self.stderr.flush()
        return status


def _text(raw: _Patient, before: TextIO | None) -> io.TextIOWrapper:
    """Text to a descriptor as `before` took it."""
    encoding, errors = getattr(before, "encoding", None) or "utf-8", getattr(before, "errors", None) or "strict"
    by_line = getattr(before, "line_buffering", False) or getattr(before, "write_through", False)
    return io.TextIOWrapper(io.BufferedWriter(raw), encoding, errors, line_buffering=by_line)
