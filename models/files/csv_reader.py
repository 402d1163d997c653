"""Numbers out of a CSV file of any size: one too large or broken is refused and never fills the memory."""

import csv
import gzip
import io
import math
import zlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models.files import csv_text
from models.files.access import WINDOWS, encoding_of, opened
from models.files.lvm import as_table

ENDINGS = tuple(form + packed for form in (".csv", ".tsv", ".txt", ".dat", ".lvm") for packed in ("", ".gz"))
BLOCK_CHARACTERS = 1 << 22  # read at once
MOST_CELLS = 32_000_000  # numbers of a table: 256 MB
LONGEST_LINE = 1 << 20  # characters
MOST_COLUMNS = 256  # of a table of measurements
MOST_CHARACTERS = 1 << 30  # of a file: 1 GB
MOST_BLANK = 1_000_000  # lines without a value
MISSING = ("", "nan", "na", "n/a", "#n/a", "null", "none")  # cells of what was not measured
_START = 1 << 16  # bytes from which the encoding is recognised


@dataclass(frozen=True)
class CsvTable:
    """Columns `values` (rows, columns) under the `header`, the file's line of each row, the units stated by column."""

    header: list[str]
    units: Mapping[str, str]
    values: NDArray[np.float64]
    lines: NDArray[np.int64]


Check = Callable[[list[str], Mapping[str, str]], Sequence[str]]


def read_table(
    path: Path,
    check: Check,
    what: str = "record",
    most_rows: int = MOST_CELLS,
    names: Collection[str] = (),
    clocks: Collection[str] = (),
    once: Collection[str] = (),
    gaps: Collection[str] = (),
) -> CsvTable:
    """The table of a file that holds `what`, of at most `most_rows`.

    `check` gets the header and the units that the file states by column; it returns the columns that must be finite,
    but for `MISSING` cells of `gaps`. Other cells that are no numbers become NaN. Separators are comma, semicolon, tab
    or spaces (all but the comma allow a decimal comma). UTF-8, UTF-16, UTF-32, Windows-1252, gzip are recognised, also
    lines above the header, which has one of `names`, and a row of units below it. Columns among `clocks` may hold dates
    and times of day. Further columns of one name are numbered (`Time`, `Time 2`), but for those of `once`.
    """
    with _opened(path) as text:
        lines = _lines(path, text)
        if path.name.lower().removesuffix(".gz").endswith(".lvm"):
            lines = as_table(str(path), lines)
        top = list(islice(lines, csv_text.LONGEST_TOP))
        form = csv_text.find_header([line for _, line in top], names)
        if form is None:
            raise ValueError(f"{path}: record must have a header row and samples; got an empty file")
        header, bare = _header(path, form.line, form.separator, once)
        units = dict(zip(header, form.units, strict=False))
        needed = frozenset(_checked(header, units, check, text.encoding))
        rows = _Rows(str(path), header, form.separator, needed, frozenset(clocks), frozenset(gaps))
        most = min(most_rows, MOST_CELLS // len(header))
        for block in _blocks(chain(top[form.rows - bare :], lines)):
            rows.take(block)
            if rows.count > most:
                raise ValueError(
                    f"{path}: {what} with {len(header)} columns must have at most {most} rows; got more: cut it into"
                    " several records, drop columns or sample it more slowly"
                )
        return CsvTable(header, units, np.concatenate(rows.values), np.concatenate(rows.lines))


def _blocks(lines: Iterator[tuple[int, str]]) -> Iterator[list[tuple[int, str]]]:
    """The lines in blocks of a bounded size; the last one may be empty."""
    block, size = list[tuple[int, str]](), 0
    for number, line in lines:
        block.append((number, line))
        size += len(line)
        if size > BLOCK_CHARACTERS:
            yield block
            block, size = [], 0
    yield block


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
def _opened(path: Path) -> Iterator[io.TextIOWrapper]:
    """The text of a file, packed or not, in the encoding that it begins with."""
    if not path.name.lower().endswith(ENDINGS):
        raise ValueError(
            f"{path}: record must be text (.csv, .tsv, .txt, .dat, each also .gz) or of a format that `capsule convert"
            f" --help` lists; got {path.name!r}: export it as CSV"
        )
    try:
        with opened(path, "record") as file:
            packed = file.read(2) == b"\x1f\x8b"
            file.seek(0)
            with gzip.open(file, "rb") if packed else file as plain:
                encoding = encoding_of(plain.read(_START))
                plain.seek(0)
                with io.TextIOWrapper(plain, encoding=encoding, errors="replace", newline=None) as text:
                    yield text
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise ValueError(f"{path}: file must be complete gzip data; got a truncated or damaged one ({error})") from None
    except OSError as error:
        raise ValueError(f"{path}: record must be a file that can be read; got: {error.strerror or error}") from None


def _lines(path: Path, text: io.TextIOWrapper) -> Iterator[tuple[int, str]]:
    """Non-blank lines with their numbers, counted from 1."""
    blank, total = 0, 0
    for number, line in enumerate(iter(lambda: text.readline(LONGEST_LINE + 1), ""), 1):
        total, blank = total + len(line), blank + line.isspace()
        wrong = ""
        if len(line) > LONGEST_LINE:
            wrong = f"line must be shorter than {LONGEST_LINE} characters; got a longer one: is this a CSV file?"
        elif total > MOST_CHARACTERS:
            wrong = f"text must be at most {MOST_CHARACTERS} characters, unpacked; got more"
        elif blank > MOST_BLANK:
            wrong = f"record must have at most {MOST_BLANK} empty lines; got more"
        if wrong:
            raise ValueError(f"{path}, line {number}: {wrong}")
        if not line.isspace():
            yield number, line.rstrip("\n")


def _header(path: Path, line: str, separator: str, once: Collection[str]) -> tuple[list[str], bool]:
    """The names of the columns, and whether they are ours, for a file that begins with numbers."""
    header = [csv_text.bare(name) for name in _split(f"{path}, header", line, separator)]
    if len(header) > MOST_COLUMNS:
        raise ValueError(f"{path}: header must have at most {MOST_COLUMNS} columns; got {len(header)}")
    named = [name for name in header if name]
    if all(not np.isnan(csv_text.clock_s(name.replace(",", "."))) for name in named):
        return [f"column {number}" for number in range(1, len(header) + 1)], True
    twice = [name for name in named if name in once and named.count(name) > 1]
    if twice:
        raise ValueError(f"{path}: header must name each column once; got {twice[0]!r} twice")
    return _numbered(header), False


def _numbered(header: Sequence[str]) -> list[str]:
    """The names, with a number after each repeated one."""
    given: list[str] = []
    for name in header:
        own, number = name, 2
        while own and (own in given or (own != name and own in header)):
            own, number = f"{name} {number}", number + 1
        given.append(own)
    return given


def _split(where: str, line: str, separator: str) -> list[str]:
    try:
        return csv_text.split(line, separator)
    except csv.Error as error:
        raise ValueError(f"{where}: row must be plain CSV; got: {error}") from None


@dataclass
class _Rows:
    """The rows so far: a block is read by NumPy where every cell is a number, else cell by cell."""

    where: str
    header: list[str]
    separator: str
    needed: frozenset[str]
    clocks: frozenset[str]
    gaps: frozenset[str]
    values: list[NDArray[np.float64]] = field(default_factory=list)
    lines: list[NDArray[np.int64]] = field(default_factory=list)
    count: int = 0
    last_stamp: float = math.nan

    def take(self, block: list[tuple[int, str]]) -> None:
        grouped, plain = csv_text.may_group([line for _, line in block], self.separator), block
        if self.separator != ",":
            plain = [(number, self._pointed(line)) for number, line in block]
        separator, shape = None if self.separator == csv_text.SPACES else self.separator, (len(block), len(self.header))
        values = np.zeros(shape)
        try:
            if grouped:
                raise ValueError
            if block:
                text = [line for _, line in plain]
                values = np.loadtxt(text, delimiter=separator, comments=None, ndmin=2, quotechar='"')
        except ValueError:
            values = self._by_cell(block)
        if values.shape != shape:
            self._by_cell(block)
            lines = f"lines {block[0][0]} to {block[-1][0]}"
            raise ValueError(f"{self.where}, {lines}: rows must be plain numbers; got an unbalanced quote")
        self._refuse_not_finite(values, block)
        self.values.append(values)
        self.lines.append(np.array([number for number, _ in block], dtype=np.int64))
        self.count += len(block)

    def _by_cell(self, block: list[tuple[int, str]]) -> NDArray[np.float64]:
        """The numbers of a block, NaN where a cell is none, stamps in s."""
        rows = [self._cells(number, line) for number, line in block]
        columns = [csv_text.ungrouped(column, self.separator) for column in zip(*rows, strict=True)]
        values = np.array([[csv_text.to_number(cell) for cell in column] for column in columns]).T
        for column, name in enumerate(self.header):
            if name in self.clocks and np.isnan(values[:, column]).any():
                stamps = np.array([csv_text.clock_s(self._pointed(row[column])) for row in rows])
                values[:, column] = csv_text.over_midnight(stamps, self.last_stamp)
                self.last_stamp = float([self.last_stamp, *stamps[np.isfinite(stamps)]][-1])
        return values

    def _pointed(self, cell: str) -> str:
        return cell if self.separator == "," else cell.replace(",", ".")

    def _cells(self, number: int, line: str) -> list[str]:
        cells = _split(f"{self.where}, line {number}", line, self.separator)
        if len(cells) != len(self.header):
            rule = f"row must have {len(self.header)} values as the header has"
            raise ValueError(f"{self.where}, line {number}: {rule}; got {len(cells)}")
        return cells

    def _refuse_not_finite(self, values: NDArray[np.float64], block: list[tuple[int, str]]) -> None:
        needed = [column for column, name in enumerate(self.header) if name in self.needed]
        for row, column in np.argwhere(~np.isfinite(values[:, needed])):
            name, (number, line) = self.header[needed[column]], block[row]
            cell = csv_text.split(line, self.separator)[needed[column]].strip()
            if cell.lower() not in MISSING or name not in self.gaps:
                raise ValueError(f"{self.where}, line {number}: {name} must be a finite number; got {cell[:40]!r}")
