"""Text logs as python-can reads them: candump's file or screen with any of its stamps, and ASC with negative ones."""

import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import can
import numpy as np

from hil.log.blf_reader import Tell
from models.files.access import opened
from models.files.csv_text import clock_s
from models.records.clock import are_differences, left_out

_LONGEST_LINE: Final = 1 << 12  # characters; the longest frame has 64 bytes
_SHOWN: Final = 3  # lines that are named
_FILE: Final = re.compile(r"\(([^)]*)\)\s+(\S+)\s+([0-9A-Fa-f]+#\S*)(?:\s+([RTrt]))?")
_SCREEN: Final = re.compile(
    r"(?:\(([^)]*)\)\s+)?(\S+)\s+(?:([RT])X\s+\S\s+\S\s+)?([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[\d+\]"
    r"\s*((?:[0-9A-Fa-f]{2}\b\s*)*|remote request|ERRORFRAME)(?:'.*')?"
)
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
        negative = [float(found[1]) for line in _lines(path) if (found := _ASC.match(line))]
        late = float(np.ceil(-min(negative, default=0.0)))
        return can.ASCReader(_Lines(_later(path, late))), late  # type: ignore[arg-type]
    return can.CanutilsLogReader(_Lines(_frames(path, tell))), 0.0  # type: ignore[arg-type]


def _lines(path: Path) -> Iterator[str]:
    with opened(path, "log") as file, io.TextIOWrapper(file, "utf-8", "replace") as text:
        yield from iter(lambda: text.readline(_LONGEST_LINE), "")


def _later(path: Path, late: float) -> Iterator[str]:
    """The lines with all stamps later, so that none is negative."""
    stamped = re.compile(r"\s*(-?\d+\.\d+)(\s+(?:\d|CANFD).*)", re.DOTALL) if late else None
    for line in _lines(path):
        found = stamped.match(line) if stamped else None
        yield f"{float(found[1]) + late:.9f}{found[2]}" if found else line


def _frames(path: Path, tell: Tell) -> Iterator[str]:
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
        tell(left_out("unread", path.name, np.zeros(len(odd)), total, places=odd[:_SHOWN]).sentence)
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
