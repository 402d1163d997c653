"""A measured record: columns of one CSV, checked against what its kind of rig needs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.files.csv_reader import Block, read_blocks
from models.records.header import check_header, check_unit_names, missing_in_layouts
from models.records.proposal import proposed, to_scale, toml_lines
from models.rigs.columns import TIME, Columns
from models.rigs.kind import RigKind
from models.rigs.kinds import KINDS
from models.rigs.mapping import MappedColumn, check_stated
from models.rigs.rig import Rig

Array = NDArray[np.float64]
MOST_CELLS = 32_000_000  # numbers of a record: 256 MB
USED = "_used"
"""Column of a record: 1 where the measured value counts, 0 where there is none or it was filled in."""
LARGEST_SAMPLE = 1e12
"""Beyond it nothing can be said of a sample, by the checks of records either."""


@dataclass(frozen=True)
class Record:
    """One record in memory; `columns` maps a column's name to its samples, all of one length; `notes` say what reading
    it took, such as resampling. `source` is the file that it was read from and `lines` the line of each row there.
    """

    name: str
    kind: str
    columns: dict[str, Array]
    source: str = ""
    lines: NDArray[np.int64] | None = field(default=None, compare=False, repr=False)
    notes: tuple[str, ...] = ()

    def __getitem__(self, column: str) -> Array:
        return self.columns[column]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    @property
    def layout(self) -> Columns:
        """What its kind of record holds, in the variant that these columns are of."""
        return KINDS[self.kind].columns(self.columns)

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


def kept_between(where: str, name: str, values: Array, least: int) -> dict[str, Array]:
    """The measured column `name` kept in rows where it has no value (NaN), and `USED`; nothing where it has all. Raises
    ValueError where it has fewer than `least`.
    """
    there = np.isfinite(values)
    if there.all():
        return {}
    if there.sum() < least:
        raise ValueError(
            f"{where}: {name} must hold a number in at least {least} rows; got {there.sum()} in {len(values)}"
        )
    last = np.maximum.accumulate(np.where(there, np.arange(len(values)), np.argmax(there)))
    return {name: values[last], USED: there.astype(float)}


def where_measured(record: Record) -> Record:
    """The rows of `record` in which the measured column has a value."""
    return record.rows(record[USED] > 0) if USED in record.columns else record


def as_measured(record: Record) -> dict[str, Array]:
    """The columns of `record` as a file has them: NaN where nothing was measured."""
    if USED not in record.columns:
        return record.columns
    columns = {name: values for name, values in record.columns.items() if name != USED}
    for name in KINDS[record.kind].columns(columns).measured:
        columns[name] = np.where(record[USED] > 0, columns[name], np.nan)
    return columns


@contextmanager
def named(record: Record) -> Iterator[None]:
    """Whatever is refused within says which record it is about."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{record.name}: {error}") from None


def read_record(path: Path, rig: Rig, *, driven_only: bool = False, lenient: bool = False) -> Record:
    """Read a `.csv` or `.csv.gz` record of `rig` (or `.tsv`, `.txt`), whose `columns` say what stands for ours; what is
    wrong with it is a ValueError of one sentence with file, line, column.

    With `driven_only` the measured columns may be missing and a single row is enough: what a prediction needs.
    Columns beyond the kind's own are kept where they hold numbers. The measured column of a time series may be empty in
    rows where nothing was measured: it keeps its value there, and the column `USED` says where it has one of its own.
    A `lenient` reading takes times and ranges as they stand: what the checks say something about.
    """
    path = Path(path)
    reading = _Reading(str(path), rig, driven_only, lenient)
    names = {*KINDS[rig.kind].known, *(entry.column for entry in rig.columns.entries)}
    clocks = {TIME, *(entry.column for entry in rig.columns.entries if entry.target == TIME)}
    gaps = {*reading.sparse, *(entry.column for entry in rig.columns.entries if entry.target in reading.sparse)}
    for header, block in read_blocks(path, reading.check_header, names, clocks, KINDS[rig.kind].known, gaps):
        reading.take(header, block)
    return _complete(_name(path), str(path), reading)


def record_of(
    name: str,
    columns: Mapping[str, Array],
    rig: Rig,
    *,
    where: str = "",
    units: Mapping[str, str] = MappingProxyType({}),
    driven_only: bool = False,
    notes: tuple[str, ...] = (),
) -> Record:
    """A record of `rig` from arrays (n,) by column name in the stated `units`, checked as `read_record` checks a file;
    a line is a row. A measured column of a time series may hold NaN, where nothing was measured.
    """
    where = where or name
    lengths = {column: np.shape(values) for column, values in columns.items()}
    if not columns or len(set(lengths.values())) != 1 or any(len(shape) != 1 for shape in lengths.values()):
        raise ValueError(f"{where}: columns must be arrays of one dimension and one length; got {lengths}"[:300])
    reading = _Reading(where, rig, driven_only)
    header = list(columns)
    checked = reading.check_header(header, units)
    gaps = {source.column for target, source in reading.sources.items() if target in reading.sparse}
    for column in checked:
        wrong = np.isinf(columns[column]) if column in gaps else ~np.isfinite(columns[column])
        if wrong.any():
            row = int(np.argmax(wrong))
            raise ValueError(f"{where}, row {row}: {column} must be a finite number; got {columns[column][row]}")
    values = np.column_stack([np.asarray(columns[column], dtype=float) for column in header])
    reading.take(header, Block(values, np.arange(len(values))))
    return replace(_complete(name, where, reading), notes=notes)


def find_columns(
    where: str, rig: Rig, header: Sequence[str], units: Mapping[str, str], driven_only: bool
) -> dict[str, MappedColumn]:
    """Where each column of ours stands in the `header` of a file that states these `units`, as `[columns]` of the rig
    says.

    Raises ValueError of one sentence for a column that is missing; where others may be meant, a note of the error is
    the table `[columns]` to paste into the rig file.
    """
    targets = [*header, *(entry.target for entry in rig.columns.entries)]
    optional = KINDS[rig.kind].columns(targets).measured if driven_only else ()
    sources = rig.columns.sources(where, header, KINDS[rig.kind].known, optional)
    read = {source.column for source in sources.values()}
    ours = [*sources, *(name for name in header if name not in read)]
    try:
        check_header(where, KINDS[rig.kind], ours, with_measured=not driven_only)
        check_unit_names(where, KINDS[rig.kind], ours)
        check_stated(where, sources, units)
    except ValueError as error:
        raise _with_proposal(error, where, rig, header, units, sources) from None
    return sources


def _with_proposal(
    error: ValueError,
    where: str,
    rig: Rig,
    header: Sequence[str],
    units: Mapping[str, str],
    sources: Mapping[str, MappedColumn],
) -> ValueError:
    """The error with a table `[columns]` that may put it right, where one can be found."""
    good = {target: source for target, source in sources.items() if _agrees(where, target, source, units)}
    used = {source.column for source in good.values()}
    free = [name for name in header if name not in used]
    variants = missing_in_layouts(KINDS[rig.kind], list(good))
    likely = [(proposed(free, missing, units, optional), missing) for missing, optional in variants]
    found, missing = max(likely, key=lambda one: len(one[0]))
    raw = to_scale(free, missing, units, found)
    if not (found or raw) or "columns of kind" in str(error):
        return error
    entries = [*(source for source in good.values() if not source.plain), *found]
    words = "reads it, if it is what is meant" if not raw else "is what it would take, with numbers for the dots"
    told = ValueError(f"{error}; this table in the rig file {words}:")
    told.add_note("\n".join([toml_lines(entries), *raw]))
    return told


def _agrees(where: str, target: str, source: MappedColumn, units: Mapping[str, str]) -> bool:
    try:
        check_stated(where, {target: source}, units)
    except ValueError:
        return False
    return True


def _complete(name: str, where: str, reading: _Reading) -> Record:
    rig, columns = reading.rig, reading.columns()
    if "velocity_m_s" in KINDS[rig.kind].layout.given_by_rig and "velocity_m_s" not in columns:
        if rig.velocity_m_s is None:
            raise ValueError(f"{where}: velocity_m_s must be a column of the record or a key under [rig]; got neither")
        columns["velocity_m_s"] = np.full(reading.rows, rig.velocity_m_s)
    return Record(name, rig.kind, columns, where, reading.lines())


def _name(path: Path) -> str:
    name = path.name
    for ending in (".gz", ".csv", ".tsv", ".txt"):
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
    sources: dict[str, MappedColumn] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def kind(self) -> RigKind:
        """The rig's kind."""
        return KINDS[self.rig.kind]

    @property
    def sparse(self) -> tuple[str, ...]:
        """Our columns that need no value in every row."""
        return tuple(name for one in self.kind.layouts if one.time for name in one.measured)

    def check_header(self, header: list[str], units: Mapping[str, str]) -> list[str]:
        """Find our columns in the header of a file that states these `units`; the names of those that are read."""
        self.sources = find_columns(self.where, self.rig, header, units, self.driven_only)
        self.units = units
        return [source.column for source in self.sources.values()]

    def take(self, header: Sequence[str], block: Block) -> None:
        """Add the rows of `block` to the record."""
        if any(not source.plain for source in self.sources.values()):
            header, block = self._ours(header, block)
        self.header = header
        self.rows += len(block.lines)
        limit = min(self.kind.layout.limit, MOST_CELLS // len(header))
        if self.rows > limit:
            raise ValueError(
                f"{self.where}: record of kind {self.kind.id} with {len(header)} columns must have at most {limit}"
                " rows; got more: cut it into several records, drop columns or sample it more slowly"
            )
        if not self.lenient:
            self._check_time(block)
            self._check_ranges(block)
        else:
            self._check_ranges(block, beyond=LARGEST_SAMPLE)
        self._check_peaks(block)
        self.blocks.append(block.values)
        self.numbers.append(block.lines)

    def lines(self) -> NDArray[np.int64]:
        """The line of each row."""
        return np.concatenate(self.numbers)

    def columns(self) -> dict[str, Array]:
        """The record's columns by name, once all blocks are taken."""
        layout = self.kind.layout
        least = (2 if layout.time else 1) if self.driven_only else layout.minimum
        if self.rows < least:
            raise ValueError(
                f"{self.where}: record of kind {self.kind.id} must have at least {least} rows; got {self.rows}"
            )
        columns: dict[str, Array] = {}
        for index, name in enumerate(self.header):
            column = np.concatenate([values[:, index] for values in self.blocks])
            if name in self.sources:
                source = self.sources[name]
                column = source.unwrapped(column, self.units.get(source.column, ""))
            if name and (name in self.kind.known or not np.isnan(column).all()):
                columns[name] = column
        for name in (name for name in self.sparse if name in columns):
            columns |= kept_between(self.where, name, columns[name], least)
        return columns

    def _ours(self, header: Sequence[str], block: Block) -> tuple[Sequence[str], Block]:
        """The block with our columns first, then those that are further ones."""
        read = {source.column for source in self.sources.values()}
        further = [k for k, name in enumerate(header) if name not in read and name not in self.sources]
        ours = [
            source.values(block.values[:, header.index(source.column)], self.units.get(source.column, ""))
            for source in self.sources.values()
        ]
        values = np.column_stack([*ours, block.values[:, further]])
        return [*self.sources, *(header[k] for k in further)], Block(values, block.lines)

    def _check_time(self, block: Block) -> None:
        if not self.kind.layout.time or not len(block.lines):
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

    def _check_ranges(self, block: Block, beyond: float = 0.0) -> None:
        """Refuse values out of the ranges of our columns; only those `beyond` a size, where that is given."""
        for index, name in enumerate(self.header):
            limits = self.kind.range(name) if name in self.kind.known else None
            row = self.kind.first_wrong(name, block.values[:, index])
            if row is not None and beyond:
                far = np.flatnonzero(np.abs(block.values[:, index]) > beyond)
                row = int(far[0]) if far.size else None
            if limits is not None and row is not None:
                raise ValueError(
                    f"{self.where}, line {block.lines[row]}: {name} must be {limits.words}; got"
                    f" {block.values[row, index]:g}"
                )

    def _check_peaks(self, block: Block) -> None:
        rising = self.kind.rising
        if rising is None or not set(rising) <= set(self.header):
            return
        low, high = (block.values[:, list(self.header).index(name)] for name in rising)
        wrong = np.flatnonzero(~(high > low))
        if wrong.size:
            row = int(wrong[0])
            raise ValueError(
                f"{self.where}, line {block.lines[row]}: {rising[1]} must be above {rising[0]}; got {high[row]:g} and"
                f" {low[row]:g}"
            )
