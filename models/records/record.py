"""A measured record: columns of one CSV, checked against what its kind of rig needs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.files.csv_reader import CsvTable, read_table
from models.files.units import unit_of
from models.records.found_columns import check_header, missing_in_layouts, proposed, to_scale, toml_lines
from models.rigs.columns import TIME, Columns
from models.rigs.kind import RigKind
from models.rigs.kinds import KINDS
from models.rigs.mapping import MappedColumn, contradiction
from models.rigs.rig import Rig

Array = NDArray[np.float64]
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
    path, kind, sources = Path(path), KINDS[rig.kind], dict[str, MappedColumn]()

    def check(header: list[str], units: Mapping[str, str]) -> list[str]:
        sources.update(find_columns(str(path), rig, header, units, driven_only))
        return [source.column for source in sources.values()]

    sparse = _sparse(kind)
    table = read_table(
        path,
        check,
        f"record of kind {kind.id}",
        kind.layout.limit,
        names={*kind.known, *(entry.column for entry in rig.columns.entries)},
        clocks={TIME, rig.columns.entry(TIME).column},
        once=kind.known,
        gaps={*sparse, *(rig.columns.entry(name).column for name in sparse)},
    )
    return _record(_name(path), str(path), rig, table, sources, driven_only, lenient)


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
    where, header = where or name, list(columns)
    lengths = {column: np.shape(values) for column, values in columns.items()}
    if not columns or len(set(lengths.values())) != 1 or any(len(shape) != 1 for shape in lengths.values()):
        raise ValueError(f"{where}: columns must be arrays of one dimension and one length; got {lengths}"[:300])
    sources = find_columns(where, rig, header, units, driven_only)
    for target, source in sources.items():
        values = columns[source.column]
        wrong = np.isinf(values) if target in _sparse(KINDS[rig.kind]) else ~np.isfinite(values)
        if wrong.any():
            row = int(np.argmax(wrong))
            raise ValueError(f"{where}, row {row}: {source.column} must be a finite number; got {values[row]}")
    values = np.column_stack([np.asarray(columns[column], dtype=float) for column in header])
    table = CsvTable(header, units, values, np.arange(len(values)))
    return replace(_record(name, where, rig, table, sources, driven_only), notes=notes)


def _sparse(kind: RigKind) -> tuple[str, ...]:
    """Our columns that need no value in every row."""
    return tuple(name for one in kind.layouts if one.time for name in one.measured)


def find_columns(
    where: str, rig: Rig, header: Sequence[str], units: Mapping[str, str], driven_only: bool
) -> dict[str, MappedColumn]:
    """Where each column of ours stands in the `header` of a file that states these `units`, as `[columns]` of the rig
    says.

    Raises ValueError of one sentence for a column that is missing; where others may be meant, a note of the error is
    the table `[columns]` to paste into the rig file.
    """
    targets = [*header, *(entry.target for entry in rig.columns.entries)]
    kind = KINDS[rig.kind]
    optional = kind.columns(targets).measured if driven_only else ()
    sources = rig.columns.sources(where, header, kind.known, optional)
    read = {source.column for source in sources.values()}
    ours = [*sources, *(name for name in header if name not in read)]
    try:
        check_header(where, kind, ours, with_measured=not driven_only)
        for target, source in sources.items():
            if stated := contradiction(target, source, units):
                wanted = unit_of(target) or "plain numbers"
                raise ValueError(f"{where}: column {target} must be in {wanted}; the file states {stated}")
    except ValueError as error:
        raise _with_proposal(error, rig, header, units, sources) from None
    return sources


def _with_proposal(
    error: ValueError, rig: Rig, header: Sequence[str], units: Mapping[str, str], sources: Mapping[str, MappedColumn]
) -> ValueError:
    """The error with a table `[columns]` that may put it right, where one can be found."""
    good = {target: source for target, source in sources.items() if not contradiction(target, source, units)}
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


def _record(
    name: str,
    where: str,
    rig: Rig,
    table: CsvTable,
    sources: Mapping[str, MappedColumn],
    driven_only: bool,
    lenient: bool = False,
) -> Record:
    """The record of a table in which our columns stand at their `sources`, checked row by row."""
    kind, rows, raw = KINDS[rig.kind], len(table.lines), dict(zip(table.header, table.values.T, strict=True))
    ours = {
        target: source.values(raw[source.column], table.units.get(source.column, ""))
        for target, source in sources.items()
    }
    read = {source.column for source in sources.values()}
    further = {key: raw[key].copy() for key in table.header if key and key not in read and not np.isnan(raw[key]).all()}
    columns = {**ours, **{key: values for key, values in further.items() if key not in ours}}
    if all(source.plain for source in sources.values()):
        columns = {key: columns[key] for key in table.header if key in columns}
    _refuse_wrong(where, kind, columns, table.lines, lenient)
    least = (2 if kind.layout.time else 1) if driven_only else kind.layout.minimum
    if rows < least:
        raise ValueError(f"{where}: record of kind {kind.id} must have at least {least} rows; got {rows}")
    for key in (key for key in _sparse(kind) if key in ours):
        columns |= kept_between(where, key, columns[key], least)
    if "velocity_m_s" in kind.layout.given_by_rig and "velocity_m_s" not in columns:
        if rig.velocity_m_s is None:
            raise ValueError(f"{where}: velocity_m_s must be a column of the record or a key under [rig]; got neither")
        columns["velocity_m_s"] = np.full(rows, rig.velocity_m_s)
    return Record(name, rig.kind, columns, where, table.lines)


def _refuse_wrong(
    where: str, kind: RigKind, columns: Mapping[str, Array], lines: NDArray[np.int64], lenient: bool
) -> None:
    """Refuse stamps that do not rise, values of our columns out of their ranges (where `lenient` those of a size of
    which nothing can be said), and valleys above their peaks.
    """
    if kind.layout.time and not lenient:
        time = columns[TIME]
        wrong = ~(np.diff(time) > 0)
        if wrong.any():
            row = int(np.argmax(wrong)) + 1
            raise ValueError(
                f"{where}, line {lines[row]}: t_s must increase; got {time[row]:.12g} after {time[row - 1]:.12g}"
            )
    for name, values in ((name, values) for name, values in columns.items() if name in kind.known):
        limits = kind.range(name)
        if limits is not None:
            wrong = ~limits.holds(values) & (not lenient or np.abs(values) > LARGEST_SAMPLE)
            if wrong.any():
                row = int(np.argmax(wrong))
                raise ValueError(f"{where}, line {lines[row]}: {name} must be {limits.words}; got {values[row]:g}")
    if kind.rising is not None and set(kind.rising) <= columns.keys():
        low, high = kind.rising
        wrong = ~(columns[high] > columns[low])
        if wrong.any():
            row = int(np.argmax(wrong))
            raise ValueError(
                f"{where}, line {lines[row]}: {high} must be above {low}; got {columns[high][row]:g} and"
                f" {columns[low][row]:g}"
            )


def _name(path: Path) -> str:
    """The file's name without its endings."""
    return re.sub(r"(?i)(\.(csv|tsv|txt))?(\.gz)?$", "", path.name, count=1) or path.name
