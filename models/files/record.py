"""A measured record: columns of one CSV, checked against what its kind of rig needs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.files.columns import COLUMNS, RANGES, TIME, check_header, check_unit_names, first_wrong
from models.files.csv_reader import Block, read_blocks
from models.files.rig import Rig

Array = NDArray[np.float64]
MOST_CELLS = 32_000_000


@dataclass(frozen=True)
class Record:
    """One record in memory; `columns` maps a column's name to its samples, all of one length. `source` is the file
    that it was read from and `lines` the line of each row there.
    """

    name: str
    kind: str
    columns: dict[str, Array]
    source: str = ""
    lines: NDArray[np.int64] | None = field(default=None, compare=False, repr=False)

    def __getitem__(self, column: str) -> Array:
        return self.columns[column]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def line(self, row: int) -> int:
        """Line of the file on which `row` stands; the row's own number where there is no file."""
        return int(row) if self.lines is None else int(self.lines[row])

    def with_column(self, column: str, values: Any) -> Record:
        """The same record with one column replaced or added."""
        return replace(self, columns={**self.columns, column: np.asarray(values, dtype=float)})

    def without(self, columns: Sequence[str]) -> Record:
        """The same record without `columns`."""
        return replace(self, columns={key: column for key, column in self.columns.items() if key not in columns})

    def rows(self, index: Any) -> Record:
        """The same record with only the rows of `index`."""
        return replace(
            self,
            columns={key: column[index] for key, column in self.columns.items()},
            lines=None if self.lines is None else self.lines[index],
        )

    def beginning(self, length: float) -> Record:
        """The same record's first `length` s."""
        t = self["t_s"]
        return self.rows(slice(0, int(np.searchsorted(t, t[0] + length))))


@contextmanager
def named(record: Record) -> Iterator[None]:
    """Whatever is refused within says which record it is about."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{record.name}: {error}") from None


def read_record(path: Path, rig: Rig, *, driven_only: bool = False, lenient: bool = False) -> Record:
    """Read a `.csv` or `.csv.gz` record of `rig`; what is wrong with it is a ValueError of one sentence with file,
    line, column.

    With `driven_only` the measured columns may be missing and a single row is enough: what a prediction needs.
    Columns beyond the kind's own are kept where they hold numbers. A `lenient` reading takes times and ranges as they
    stand: what the checks say something about.
    """
    path = Path(path)
    reading = _Reading(str(path), rig, driven_only, lenient)
    for header, block in read_blocks(path, reading.check_header):
        reading.take(header, block)
    return _complete(_name(path), str(path), reading)


def record_of(name: str, columns: Mapping[str, Array], rig: Rig) -> Record:
    """A record of `rig` from arrays (n,) by column name, checked as `read_record` checks a file; a line is a row."""
    lengths = {column: np.shape(values) for column, values in columns.items()}
    if not columns or len(set(lengths.values())) != 1 or any(len(shape) != 1 for shape in lengths.values()):
        raise ValueError(f"{name}: columns must be arrays of one dimension and one length; got {lengths}"[:300])
    reading = _Reading(name, rig, driven_only=False)
    header = list(columns)
    checked = reading.check_header(header)
    for column in checked:
        if not np.isfinite(columns[column]).all():
            row = int(np.argmin(np.isfinite(columns[column])))
            raise ValueError(f"{name}, row {row}: {column} must be a finite number; got {columns[column][row]}")
    values = np.column_stack([np.asarray(columns[column], dtype=float) for column in header])
    reading.take(header, Block(values, np.arange(len(values))))
    return _complete(name, name, reading)


def _complete(name: str, where: str, reading: _Reading) -> Record:
    rig, columns = reading.rig, reading.columns()
    if "velocity_m_s" in COLUMNS[rig.kind].given_by_rig and "velocity_m_s" not in columns:
        if rig.velocity_m_s is None:
            raise ValueError(f"{where}: velocity_m_s must be a column of the record or a key under [rig]; got neither")
        columns["velocity_m_s"] = np.full(reading.rows, rig.velocity_m_s)
    return Record(name, rig.kind, columns, where, reading.lines())


def _name(path: Path) -> str:
    name = path.name
    for ending in (".gz", ".csv"):
        if name.lower().endswith(ending):
            name = name[: -len(ending)]
    return name or path.name


@dataclass
class _Reading:
    """The blocks of one file so far; checks each block as it comes."""

    where: str
    rig: Rig
    driven_only: bool
    lenient: bool = False
    header: Sequence[str] = ()
    blocks: list[Array] = field(default_factory=list)
    numbers: list[NDArray[np.int64]] = field(default_factory=list)
    rows: int = 0
    last_time: float = -np.inf

    def check_header(self, header: list[str]) -> list[str]:
        check_header(self.where, self.rig.kind, header, with_measured=not self.driven_only)
        check_unit_names(self.where, self.rig.kind, header)
        return [name for name in header if name in COLUMNS[self.rig.kind].known()]

    def take(self, header: Sequence[str], block: Block) -> None:
        """Add the rows of `block` to the record."""
        self.header = header
        self.rows += len(block.lines)
        limit = min(COLUMNS[self.rig.kind].limit, MOST_CELLS // len(header))
        if self.rows > limit:
            raise ValueError(
                f"{self.where}: record of kind {self.rig.kind} with {len(header)} columns must have at most {limit}"
                " rows; got more: cut it into several records, drop columns or sample it more slowly"
            )
        if not self.lenient:
            self._check_time(block)
            self._check_ranges(block)
        self._check_peaks(block)
        self.blocks.append(block.values)
        self.numbers.append(block.lines)

    def lines(self) -> NDArray[np.int64]:
        """The line of each row."""
        return np.concatenate(self.numbers)

    def columns(self) -> dict[str, Array]:
        """The record's columns by name, once all blocks are taken."""
        kind = COLUMNS[self.rig.kind]
        least = (2 if kind.time else 1) if self.driven_only else kind.minimum
        if self.rows < least:
            raise ValueError(
                f"{self.where}: record of kind {self.rig.kind} must have at least {least} rows; got {self.rows}"
            )
        columns: dict[str, Array] = {}
        for index, name in enumerate(self.header):
            column = np.concatenate([values[:, index] for values in self.blocks])
            if name and (name in kind.known() or not np.isnan(column).all()):
                columns[name] = column
        return columns

    def _check_time(self, block: Block) -> None:
        if not COLUMNS[self.rig.kind].time or not len(block.lines):
            return
        time = block.values[:, list(self.header).index(TIME)]
        before = np.concatenate(([self.last_time], time[:-1]))
        wrong = np.flatnonzero(~(time > before))
        if wrong.size:
            row = int(wrong[0])
            raise ValueError(
                f"{self.where}, line {block.lines[row]}: t_s must increase; got {time[row]:.12g} after"
                f" {before[row]:.12g}"
            )
        self.last_time = float(time[-1])

    def _check_ranges(self, block: Block) -> None:
        for index, name in enumerate(self.header):
            if name not in COLUMNS[self.rig.kind].known():
                continue
            row = first_wrong(name, block.values[:, index])
            if row is not None:
                raise ValueError(
                    f"{self.where}, line {block.lines[row]}: {name} must be {RANGES[name][2]}; got"
                    f" {block.values[row, index]:g}"
                )

    def _check_peaks(self, block: Block) -> None:
        if self.rig.kind != "periods" or not {"valley_N", "peak_N"} <= set(self.header):
            return
        valley, peak = (block.values[:, list(self.header).index(name)] for name in ("valley_N", "peak_N"))
        wrong = np.flatnonzero(~(peak > valley))
        if wrong.size:
            row = int(wrong[0])
            raise ValueError(
                f"{self.where}, line {block.lines[row]}: peak_N must be above valley_N; got {peak[row]:g} and"
                f" {valley[row]:g}"
            )
