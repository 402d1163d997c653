"""Numbers out of a CSV file of any size, read in blocks: one too large or broken is refused and never fills the
memory.
"""

import csv
import gzip
import io
import math
import zlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from models.files.clock_text import clock_s, over_midnight
from models.files.csv_header import LONGEST_TOP, SPACES, EmptyError, find_header, split, to_number, unguarded
from models.files.source import WINDOWS, encoding_of, opened

ENDINGS = tuple(form + packed for form in (".csv", ".tsv", ".txt", ".dat") for packed in ("", ".gz"))
BLOCK_CHARACTERS = 1 << 22  # read at once
LONGEST_LINE = 1 << 20  # characters
MOST_COLUMNS = 256  # of a table of measurements
MOST_CHARACTERS = 1 << 30  # of a file: 1 GB
MOST_BLANK = 1_000_000  # lines without a value
_START = 1 << 16
"""Bytes by which the encoding is told."""


@dataclass(frozen=True)
class Block:
    """Rows of a table with the file's line number of each."""

    values: NDArray[np.float64]
    lines: NDArray[np.int64]


Check = Callable[[list[str], Mapping[str, str]], Sequence[str]]


def read_blocks(
    path: Path,
    check: Check,
    names: Collection[str] = (),
    clocks: Collection[str] = (),
    once: Collection[str] = (),
    gaps: Collection[str] = (),
) -> Iterator[tuple[list[str], Block]]:
    """Yield the header with each block of rows; `check` gets the header and the units that the file states by column,
    and returns the names of the columns that must be finite.

    Separators are comma, semicolon, tab or spaces (then a decimal comma is accepted). Encodings (UTF-8, UTF-16, UTF-32
    and Windows-1252) and gzip are recognised, and lines about the file before the header, which is one that has one of
    `names`, and a row of units below it. Columns among `clocks` may hold dates and times of day (`clock_s`). Cells of
    other columns that are not numbers come out as NaN. Columns of one name, as loggers write them that give every
    channel its own time, are numbered (`Time`, `Time 2`); those of `once` may stand but once. Empty cells of `gaps`
    come out as NaN, too.
    """
    with _opened(path) as file:
        try:
            encoding = encoding_of(_start(file))
            text = io.TextIOWrapper(file, encoding=encoding, errors="replace", newline=None)
            lines = _lines(path, text)
            top = list(islice(lines, LONGEST_TOP))
            form = find_header([line for _, line in top], names)
            lines = chain(top[form.rows :], lines)
            separator, header = form.separator, _header(path, form.line, form.separator, once)
            units = dict(zip(header, form.units, strict=False))
            needed = frozenset(_checked(header, units, check, encoding))
            parser = _Parser(str(path), header, separator, needed, frozenset(clocks), frozenset(gaps))
            yield header, parser.parse([])
            block: list[tuple[int, str]] = []
            size = 0
            for number, line in lines:
                block.append((number, line))
                size += len(line)
                if size > BLOCK_CHARACTERS:
                    yield header, parser.parse(block)
                    block, size = [], 0
            yield header, parser.parse(block)
        except EmptyError:
            raise ValueError(f"{path}: record must have a header row and samples; got an empty file") from None
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise ValueError(
                f"{path}: file must be complete gzip data; got a truncated or damaged one ({error})"
            ) from None
        except OSError as error:
            raise ValueError(
                f"{path}: record must be a file that can be read; got: {error.strerror or error}"
            ) from None


def _checked(header: list[str], units: Mapping[str, str], check: Check, encoding: str) -> Sequence[str]:
    try:
        return check(header, units)
    except ValueError as error:
        if encoding != WINDOWS or all(name.isascii() for name in header):
            raise
        raise ValueError(
            f"{error}; the file is no UTF-8 text and was read as Windows-1252: if its names are in another encoding,"
            " save it as 'CSV UTF-8'"
        ) from None


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    if not path.name.lower().endswith(ENDINGS):
        raise ValueError(
            f"{path}: record must be text (.csv, .tsv, .txt, .dat, each also .gz) or of a format that `capsule convert"
            f" --help` lists; got {path.name!r}: export it as CSV"
        )
    with opened(path, "record") as file:
        packed = file.read(2) == b"\x1f\x8b"
        file.seek(0)
        if packed:
            with gzip.open(file, "rb") as unpacked:
                yield unpacked  # type: ignore[misc]
        else:
            yield file


def _start(file: BinaryIO) -> bytes:
    """The first bytes of a file, which stands at its beginning again."""
    start = file.read(_START)
    file.seek(0)
    return start


def _lines(path: Path, text: io.TextIOWrapper) -> Iterator[tuple[int, str]]:
    """Non-blank lines with their numbers, counted from 1."""
    number, blank, total, rest = 0, 0, 0, ""
    while piece := text.read(BLOCK_CHARACTERS // 4):
        total += len(piece)
        if total > MOST_CHARACTERS:
            raise ValueError(
                f"{path}, line {number}: text must be at most {MOST_CHARACTERS} characters, unpacked; got more"
            )
        *complete, rest = (rest + piece).split("\n")
        for line in complete:
            number += 1
            _refuse_long(path, number, line)
            if line and not line.isspace():
                yield number, line
                continue
            blank += 1
            if blank > MOST_BLANK:
                raise ValueError(f"{path}, line {number}: record must have at most {MOST_BLANK} empty lines; got more")
        _refuse_long(path, number + 1, rest)
    if rest and not rest.isspace():
        yield number + 1, rest


def _refuse_long(path: Path, number: int, line: str) -> None:
    if len(line) > LONGEST_LINE:
        raise ValueError(
            f"{path}, line {number}: line must be shorter than {LONGEST_LINE} characters; got a longer one: is this a"
            " CSV file?"
        )


def _header(path: Path, line: str, separator: str, once: Collection[str]) -> list[str]:
    header = [unguarded(name.strip().strip('"').strip()) for name in _split(f"{path}, header", line, separator)]
    if len(header) > MOST_COLUMNS:
        raise ValueError(f"{path}: header must have at most {MOST_COLUMNS} columns; got {len(header)}")
    named = [name for name in header if name]
    if all(not np.isnan(to_number(name.replace(",", "."))) for name in named):
        raise ValueError(f"{path}: first row must name the columns; got {line[:60].strip()!r}")
    twice = [name for name in named if name in once and named.count(name) > 1]
    if twice:
        raise ValueError(f"{path}: header must name each column once; got {twice[0]!r} twice")
    return _numbered(header)


def _numbered(header: Sequence[str]) -> list[str]:
    """The names, with a number behind each that stood before."""
    given: list[str] = []
    for name in header:
        number = 2
        own = name
        while own and (own in given or (own != name and own in header)):
            own, number = f"{name} {number}", number + 1
        given.append(own)
    return given


def _split(where: str, line: str, separator: str) -> list[str]:
    try:
        return split(line, separator)
    except csv.Error as error:
        raise ValueError(f"{where}: row must be plain CSV; got: {error}") from None


def _number_or_gap(cell: str) -> float:
    """A cell as a number; NaN where it is empty. Raises ValueError for anything else."""
    if not cell.strip():
        return math.nan
    value = float(cell)
    if not math.isfinite(value):
        raise ValueError(f"number must be finite; got {cell!r}")
    return value


@dataclass
class _Parser:
    """Turns lines into rows: fast while every cell is a number, cell by cell to find the one that is not."""

    where: str
    header: list[str]
    separator: str
    needed: frozenset[str]
    clocks: frozenset[str]
    gaps: frozenset[str]

    def __post_init__(self) -> None:
        self.loose: dict[int | str, Callable[[str], float]] = {
            i: to_number for i, name in enumerate(self.header) if not name
        }
        self._clock = math.nan

    def parse(self, block: list[tuple[int, str]]) -> Block:
        numbers = np.array([number for number, _ in block], dtype=np.int64)
        if not block:
            return Block(np.empty((0, len(self.header))), numbers)
        lines = [line for _, line in block]
        if self.separator != ",":
            lines = [line.replace(",", ".") for line in lines]
        try:
            values = self._load(lines)
        except ValueError:
            self._inspect(numbers, lines)
            try:
                values = self._load(lines)
            except ValueError as error:
                got = " ".join(str(error).split())
                raise ValueError(
                    f"{self.where}, lines {numbers[0]} to {numbers[-1]}: rows must be numbers; got: {got}"
                ) from None
        if values.shape != (len(lines), len(self.header)):
            self._inspect(numbers, lines)
            raise ValueError(
                f"{self.where}, lines {numbers[0]} to {numbers[-1]}: rows must be plain numbers; got an unbalanced"
                " quote"
            )
        self._refuse_not_finite(values, numbers, lines)
        for column in (int(column) for column, read in self.loose.items() if read is clock_s):
            values[:, column] = over_midnight(values[:, column], self._clock)
            self._clock = float(values[-1, column])
        return Block(values, numbers)

    def _load(self, lines: list[str]) -> NDArray[np.float64]:
        separator = None if self.separator == SPACES else self.separator
        return np.loadtxt(
            lines, delimiter=separator, comments=None, ndmin=2, quotechar='"', converters=self.loose or None
        )

    def _inspect(self, numbers: NDArray[np.int64], lines: list[str]) -> None:
        """Raise at the first cell that must be a number and is not; remember the further columns that hold something
        else.
        """
        for number, line in zip(numbers, lines, strict=True):
            cells = _split(f"{self.where}, line {number}", line, self.separator)
            if len(cells) != len(self.header):
                raise ValueError(
                    f"{self.where}, line {number}: row must have {len(self.header)} values as the header has; got"
                    f" {len(cells)}"
                )
            for column, cell in enumerate(cells):
                name = self.header[column]
                if not np.isnan(to_number(cell)) or (column in self.loose and name not in self.gaps):
                    continue
                if name in self.gaps and not cell.strip():
                    self.loose[column] = _number_or_gap
                    continue
                if name in self.clocks and not np.isnan(clock_s(cell)):
                    self.loose[column] = clock_s
                    continue
                if name in self.needed:
                    raise self._not_finite(int(number), name, cell)
                self.loose[column] = to_number

    def _refuse_not_finite(self, values: NDArray[np.float64], numbers: NDArray[np.int64], lines: list[str]) -> None:
        for column, name in enumerate(self.header):
            holes = self.loose.get(column) is _number_or_gap
            if name in self.needed and not holes and not np.isfinite(values[:, column]).all():
                row = int(np.argmin(np.isfinite(values[:, column])))
                raise self._not_finite(int(numbers[row]), name, split(lines[row], self.separator)[column])

    def _not_finite(self, number: int, name: str, cell: str) -> ValueError:
        return ValueError(f"{self.where}, line {number}: {name} must be a finite number; got {cell.strip()[:40]!r}")
