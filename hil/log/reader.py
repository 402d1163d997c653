"""Reads CAN logs of all formats of python-can, and the record beside a log of ours.

An MF4 file, which needs asammdf, is read in a separate process, so that a damaged file does no harm.
"""

import io
import logging
import re
import warnings
from collections.abc import Iterator
from importlib import reload
from itertools import islice
from pathlib import Path
from typing import IO, Any, Final

import can
import can.io.mf4
import numpy as np

from hil.formats.channels import library, refusing
from hil.formats.mf4_file import EXTRA, check_within
from hil.formats.reading import confined, is_log, reading_process
from hil.log.blf_file import PACKED, Logged, Tell, direction_of, read_blf
from hil.log.place import record_path
from hil.own_process import error_text
from models.files.access import check_source, opened, read_json
from models.files.csv_text import clock_s
from models.records.clock import are_differences, left_out

_END: Final = 0xFFFF_FFFF
"""Identifier of the entry after the last frame: its time is the length of the sentence that follows."""
LARGEST_RECORD: Final = 1 << 26  # bytes


def read_frames(path: Path, tell: Tell | None = None) -> Iterator[Logged]:
    """The classic data frames with 11-bit identifiers of the log `path`, in its order. A log of ours has the times of
    its node's clock. Of a BLF file that is cut off the whole frames are read, and `tell` gets a sentence. Raises
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
    yield from library_frames(path, tell)


def read_log_record(path: Path) -> dict[str, Any]:
    """The record beside the log `path`. Raises ValueError of one sentence without one."""
    beside = record_path(path)
    if not beside.exists():
        raise ValueError(f"{beside}: record of the log must be there; got no such file")
    return read_json(beside, "record of the log", LARGEST_RECORD)


def library_frames(path: Path, tell: Tell | None = None) -> Iterator[Logged]:
    """The classic data frames with 11-bit identifiers of a file that python-can reads. Raises ValueError."""
    reader: Any
    late = 0.0
    try:
        if path.suffix.lower() in (".log", ".asc"):
            reader, late = text_reader(path, tell or (lambda _: None))
        else:
            reader = can.LogReader(path)
    except Exception as error:  # noqa: BLE001 - libraries raise whatever they like at a damaged file
        raise ValueError(
            f"{path}: log must be one in the format that its name ends in; got: {error_text(error, 160)}"
        ) from None
    unread, count = _Unread(), 0
    logging.getLogger("can").addHandler(unread)
    try:
        with reader:
            for count, frame in enumerate(_frames(reader, path, round(late * 1e9)), 1):  # noqa: B007
                yield frame
    finally:
        logging.getLogger("can").removeHandler(unread)
    if (n := len(unread.lines)) and tell is not None:
        places = [line.rpartition("'")[0][-_SHOWN_CHARACTERS:] for line in unread.lines[:_SHOWN]]
        tell(left_out("unread", path.name, np.full(n, np.nan), n + count, places=places).sentence)


class _Unread(logging.Handler):
    """What python-can says of the lines that it cannot read."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(record.getMessage())


def _frames(reader: Any, path: Path, late_ns: int) -> Iterator[Logged]:
    messages, count = iter(reader), 0
    while True:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                message = next(messages)
            stamp = round(message.timestamp * 1e9) - late_ns
        except StopIteration:
            return
        except Exception as error:
            if str(error).startswith(f"{path}: "):
                raise
            raise ValueError(f"{path}: log must be whole; got after {count} frames: {error_text(error, 160)}") from None
        count += 1
        if not (message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd):
            yield Logged(stamp, message.arbitration_id, bytes(message.data), direction_of(message))


def read_mf4_frames(path: Path) -> Iterator[Logged]:
    """The classic data frames with 11-bit identifiers of the MF4 file `path`. Raises ValueError of one sentence."""
    with reading_process("hil.log.reader", path) as reader:
        assert reader.stdout is not None
        yield from _received(path, reader.stdout)


def _received(path: Path, source: IO[bytes]) -> Iterator[Logged]:
    while len(data := source.read(PACKED.size)) == PACKED.size:
        time_ns, identifier, direction, size, content = PACKED.unpack(data)
        if identifier != _END:
            yield Logged(time_ns, identifier, content[:size], direction)
        elif wrong := source.read(time_ns).decode():
            raise ValueError(f"{path}: {wrong}")
        else:
            return
    raise ValueError(f"{path}: log must be a whole MF4 file; got one at which the reader ended")


def send_frames(path: Path, target: IO[bytes]) -> None:
    """Write the frames of `path` to `target`, and then a sentence if something is wrong."""
    wrong = b""
    try:
        with refusing(path, "a log"):
            library("asammdf", EXTRA)
            reload(can.io.mf4)  # it was loaded without (`hil`)
            check_within(path)
        for frame in library_frames(path):
            target.write(frame.packed())
    except ValueError as error:
        wrong = str(error).removeprefix(f"{path}: ").encode()
    target.write(PACKED.pack(len(wrong), _END, 0, 0, b"") + wrong)
    target.flush()


_LONGEST_LINE: Final = 1 << 12  # characters; the longest frame has 64 bytes
_SHOWN: Final = 3  # lines that are named
_SHOWN_CHARACTERS: Final = 40  # of such a line
_FILE: Final = re.compile(r"\(([^)]*)\)\s+(\S+)\s+([0-9A-Fa-f]+#\S*)(?:\s+([RTrt]))?")
_SCREEN: Final = re.compile(
    r"(?:\(([^)]*)\)\s+)?(\S+)\s+(?:([RT])X\s+\S\s+\S\s+)?([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[\d+\]"
    r"\s*((?:[0-9A-Fa-f]{2}\b\s*)*|remote request|ERRORFRAME)(?:'.*')?"
)
_HEAD: Final = 20  # lines of an ASC file in which its header stands
_RELATIVE: Final = re.compile(r"\s*base\s+\w+\s+timestamps\s+relative", re.IGNORECASE)
_ASC: Final = re.compile(r"\s*(-\d+\.\d+)(\s+\d+\s.*)", re.DOTALL)
Stamped = tuple[float, str]


class _Lines(io.TextIOBase):
    """An open text of the `lines` of an iterator."""

    def __init__(self, lines: Iterator[str]) -> None:
        self._lines = lines

    def readline(self, size: int | None = -1, /) -> str:  # type: ignore[override]
        return next(self._lines, "")


def text_reader(path: Path, tell: Tell) -> tuple[Any, float]:
    """python-can's reader of a `.log` or `.asc` file, and what it adds to the stamps in s. Raises ValueError."""
    if path.suffix.lower() == ".asc":
        summed = any(_RELATIVE.match(line) for line in islice(_lines(path), _HEAD))
        negative = [float(found[1]) for line in _lines(path) if (found := _ASC.match(line))]
        late = float(np.ceil(-min(negative, default=0.0)))
        if summed:
            tell(left_out("differences", path.name, np.empty(0), 1).sentence)
        return can.ASCReader(_Lines(_later(path, late, summed))), late  # type: ignore[arg-type]
    return can.CanutilsLogReader(_Lines(_candump_lines(path, tell))), 0.0  # type: ignore[arg-type]


def _lines(path: Path) -> Iterator[str]:
    with opened(path, "log") as file, io.TextIOWrapper(file, "utf-8", "replace") as text:
        yield from iter(lambda: text.readline(_LONGEST_LINE), "")


def _later(path: Path, late: float, summed: bool) -> Iterator[str]:
    """The lines with all stamps later, so that none is negative; where they are differences, with their sums."""
    stamped = re.compile(r"\s*(-?\d+\.\d+)(\s+\S.*)", re.DOTALL) if late or summed else None
    now = 0.0
    for line in _lines(path):
        found = stamped.match(line) if stamped else None
        if found:
            now = float(found[1]) + (now if summed else 0.0)
        yield f"{now + late:.9f}{found[2]}" if found else line


def _candump_lines(path: Path, tell: Tell) -> Iterator[str]:
    """The lines as `candump -L` writes them, with rising stamps; what no line of candump is, is told."""
    stamps, odd, total = list[float](), list[str](), 0
    for number, line in enumerate(_lines(path), 1):
        total += not line.isspace()
        found = _candump(line)
        if found is not None:
            stamps.append(found[0])
        elif not line.isspace():
            odd.append(f"line {number}")
    times = np.array(stamps)
    if np.isnan(times).any():
        raise ValueError(f"{path}: frames must have stamps; got one without: log with candump -L, or candump -ta")
    if odd and len(odd) < total:
        tell(left_out("unread", path.name, np.full(len(odd), np.nan), total, places=odd[:_SHOWN]).sentence)
    if summed := are_differences(times, even=False):
        tell(left_out("differences", path.name, times[:0], total).sentence)
    now = 0.0
    for line in _lines(path):
        if found := _candump(line):
            now = now + found[0] if summed else found[0]
            yield f"({now:.9f}) {found[1]}\n"
        elif len(odd) == total:
            yield line


def _candump(line: str) -> Stamped | None:
    """The stamp in s (NaN: none) and the frame of a line of candump; None of any other."""
    text = line.strip()
    if found := _FILE.fullmatch(text):
        way = f" {found[4]}" if found[4] else ""
        return clock_s(found[1]), f"{found[2]} {found[3]}{way}"
    found = _SCREEN.fullmatch(text)
    if found is None or found[5] == "ERRORFRAME":
        return None
    data = "R" if found[5] == "remote request" else "".join(found[5].split())
    return clock_s(found[1] or ""), f"{found[2]} {found[4]}#{data} {found[3] or 'R'}"


if __name__ == "__main__":
    confined(send_frames)
