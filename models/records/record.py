"""A measured record: columns of one CSV, checked against what its kind of rig needs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from models.files.access import text_of
from models.files.csv_reader import CsvTable, read_table
from models.files.units import unit_of
from models.records.clock import ASTRAY, ClockError, LeftOut, are_differences, in_order, left_out, one_clock
from models.records.direction import directed, kind_of, swings
from models.records.found_columns import check_header, nearly, proposed, to_fill_in, to_scale, toml_lines
from models.rigs.columns import TIME, Columns
from models.rigs.kind import RigKind
from models.rigs.kinds import KINDS
from models.rigs.mapping import MappedColumn, contradiction
from models.rigs.reader import record_name
from models.rigs.rig import Rig
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
Array = NDArray[np.float64]
USED = "_used"
"""Column of a record: 1 where the measured value counts, 0 where there is none or it was filled in."""
SWITCHES = ("drive_on",)
"""Columns that are constant between their changes."""
LARGEST_LOAD = 1e9  # in its unit
_LOADED = ("load", "temperature", "pressure")
LARGEST_SAMPLE = 1e12  # that the checks of records can read


@dataclass(frozen=True, eq=False)
class Record:
    """One record in memory: samples by column, all of one length; `notes` on the reading, such as resampling, and what
    it `left_out`; the `source` file, and the line of each row in one of text; `treated`: what cleaning did to it, None
    before it was cleaned. A part knows the `whole` that it is of, and the `first` of its rows there; it `began_s` later
    than what it is a part of, by the clock of what goes on in time. Its columns never change.
    """

    name: str
    kind: str
    columns: dict[str, Array]
    source: str = ""
    lines: NDArray[np.int64] | None = field(default=None, repr=False)
    notes: tuple[str, ...] = ()
    treated: tuple[str, ...] | None = None
    left_out: tuple[LeftOut, ...] = ()
    whole: Record | None = field(default=None, repr=False)
    first: int = 0
    began_s: float = 0.0

    @property
    def said(self) -> tuple[str, ...]:
        """All that there is to say of the reading."""
        return (*self.notes, *(one.sentence for one in self.left_out))

    def __getitem__(self, column: str) -> Array:
        return self.columns[column]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    @property
    def layout(self) -> Columns:
        """The columns of its kind, in the variant of this record."""
        return KINDS[self.kind].columns(self.columns)

    def line(self, row: int) -> str:
        """Where `row` stands: its line in a file of text, else its number from 1."""
        return f"sample {row + 1}" if self.lines is None else f"line {self.lines[row]}"

    def with_column(self, column: str, values: Any) -> Record:
        return self.with_columns({column: np.asarray(values, dtype=float)})

    def with_columns(self, columns: Mapping[str, Array]) -> Record:
        """The same record with `columns` replaced or added."""
        return replace(self, columns={**self.columns, **columns})

    @property
    def driven(self) -> Record:
        """The same record without what was measured."""
        return self.without((*self.layout.measured, *self.layout.beside))

    def without(self, columns: Sequence[str]) -> Record:
        return replace(self, columns={key: column for key, column in self.columns.items() if key not in columns})

    def rows(self, index: Any) -> Record:
        """The same record with only the rows of `index`."""
        columns = {key: column[index] for key, column in self.columns.items()}
        began_s = self.began_s
        if TIME in columns and len(columns[TIME]):
            began_s += float(columns[TIME][0] - self[TIME][0])
        return replace(self, columns=columns, lines=None if self.lines is None else self.lines[index], began_s=began_s)

    def part(self, first: int, last: int) -> Record:
        """The rows from `first` up to `last`, which know their whole."""
        return replace(self.rows(slice(first, last)), whole=self.whole or self, first=self.first + first)

    def beginning(self, length: float) -> Record:
        """The same record's first `length` s."""
        t = self["t_s"]
        return self.rows(slice(0, int(np.searchsorted(t, t[0] + length))))


def kept_between(where: str, name: str, values: Array, least: int) -> dict[str, Array]:
    """The measured column `name` with its last value where it has none (NaN), and `USED`; nothing where it has all.
    Raises ValueError for fewer than `least` values.
    """
    there = np.isfinite(values)
    if there.all():
        return {}
    if there.sum() < least:
        got = f"{there.sum()} in {len(values)}"
        raise ValueError(f"{where}: {name} must hold a number in at least {least} rows; got {got}")
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
    """Within it, a ValueError begins with the record's name."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{record.name}: {error}") from None


def read_record(path: Path, rig: Rig, *, driven_only: bool = False, lenient: bool = False) -> Record:
    """Read a `.csv` or `.csv.gz` record of `rig` (or `.tsv`, `.txt`). Raises ValueError with file, line and column.

    `driven_only` needs no measured columns and a single row: enough for a prediction. Columns beyond the kind's own are
    kept where they hold numbers. A measured column of a time series may be empty in some rows, which `USED` marks. A
    `lenient` reading leaves times and ranges to the checks of records.
    """
    path, kind, sources = Path(path), KINDS[rig.kind], dict[str, MappedColumn]()

    def check(header: list[str], units: Mapping[str, str]) -> list[str]:
        sources.update(find_columns(str(path), rig, header, units, driven_only))
        return [source.column for target, source in sources.items() if source.column and target not in _free(kind)]

    sparse = (*_sparse(kind), *_paced(kind))
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
    return _record(record_name(path), str(path), rig, table, sources, driven_only, lenient)


def record_of(
    name: str,
    columns: Mapping[str, Array],
    rig: Rig,
    *,
    where: str = "",
    driven_only: bool = False,
    notes: tuple[str, ...] = (),
    lost: tuple[LeftOut, ...] = (),
    lenient: bool = False,
) -> Record:
    """A record of `rig` from arrays (n,) by column name, checked as `read_record` checks a file.
    A measured column of a time series may hold NaN, where nothing was measured.
    """
    where, header = where or name, list(columns)
    lengths = {column: np.shape(values) for column, values in columns.items()}
    if not columns or len(set(lengths.values())) != 1 or any(len(shape) != 1 for shape in lengths.values()):
        raise ValueError(f"{where}: columns must be arrays of one dimension and one length; got {lengths}"[:300])
    sources, kind = find_columns(where, rig, header, {}, driven_only), KINDS[rig.kind]
    for target, source in sources.items():
        if target in _free(kind) or not source.column:
            continue
        values = columns[source.column]
        wrong = np.isinf(values) if target in (*_sparse(kind), *_paced(kind)) else ~np.isfinite(values)
        if wrong.any():
            row = int(np.argmax(wrong))
            raise ValueError(f"{where}, row {row}: {source.column} must be a finite number; got {values[row]}")
    values = np.column_stack([np.asarray(columns[column], dtype=float) for column in header])
    table = CsvTable(header, {}, values, np.arange(1, len(values) + 1))
    made = _record(name, where, rig, table, sources, driven_only, lenient, "sample")
    return replace(made, notes=(*notes, *made.notes), left_out=(*lost, *made.left_out), lines=None)


def _sparse(kind: RigKind) -> tuple[str, ...]:
    """Columns of ours that may be empty in some rows."""
    return tuple(name for one in kind.layouts if one.time for name in one.measured)


def _paced(kind: RigKind) -> tuple[str, ...]:
    """Columns of ours that may be empty where others are not: single stamps, and what has a clock of its own."""
    return (TIME, *(name for one in kind.layouts if one.time for names in one.driven for name in names))


def _free(kind: RigKind) -> tuple[str, ...]:
    """Columns of ours that are left out where they hold anything but usable numbers."""
    inputs = dict.fromkeys(name for one in kind.layouts for name in (*one.optional, *one.beside))
    return tuple(inputs) if kind.stage else kind.layout.beside


def _usable(kind: RigKind, name: str, values: Array) -> bool:
    """Whether an input has a usable number in every row; a second measured column in as many as a record needs."""
    good = np.abs(values) <= LARGEST_LOAD
    if not any(name in one.beside for one in kind.layouts):
        return bool(good.all())
    return bool(np.all(good | np.isnan(values)) and good.sum() >= kind.layout.minimum)


def find_columns(
    where: str, rig: Rig, header: Sequence[str], units: Mapping[str, str], driven_only: bool
) -> dict[str, MappedColumn]:
    """The source of each column of ours in the `header` of a file that states these `units`, by `[columns]` of the rig.
    Raises ValueError for a missing column, with a table `[columns]` to paste as its note where one is likely.
    """
    targets = [*header, *(entry.target for entry in rig.columns.entries)]
    kind = kind_of(rig, targets)
    optional = kind.columns(targets).measured if driven_only else ()
    sources = rig.columns.sources(where, header, kind.known, optional)
    read = {source.column for source in sources.values()}
    ours = [*sources, *(name for name in header if name not in read)]
    if swings(kind, ours):
        ours += kind.columns(ours).driven[0][:1]
    try:
        check_header(where, kind, ours, with_measured=not driven_only)
        for target, source in sources.items():
            if target not in _free(kind) and (stated := contradiction(target, source, units)):
                wanted = unit_of(target) or "plain numbers"
                raise ValueError(f"{where}: column {target} must be in {wanted}; the file states {stated}")
    except ValueError as error:
        raise _with_proposal(error, rig, header, units, sources) from None
    return sources


def _with_proposal(
    error: ValueError, rig: Rig, header: Sequence[str], units: Mapping[str, str], sources: Mapping[str, MappedColumn]
) -> ValueError:
    """The error with a table `[columns]` that may mend it, where one is found."""
    good = {target: source for target, source in sources.items() if not contradiction(target, source, units)}
    used = {source.column for source in good.values()}
    free = [name for name in header if name not in used]
    layouts = KINDS[rig.kind].layouts
    likely = []
    for layout in [one for one in layouts if set(one.own()) & set(good)] or layouts:
        missing = layout.lacking(good)
        likely.append((proposed(free, missing, units, [name for name in layout.optional if name not in good]), missing))
    found, missing = max(likely, key=lambda one: len(one[0]))
    raw = to_scale(free, missing, units, found)
    known = {entry.target for entry in found} | {line.split()[1] for line in raw}
    unknown = [names for names in missing if not known & set(names)]
    if len(free) >= len(unknown) or unknown == [(TIME,)]:
        raw += to_fill_in(free, unknown, clocked=any(TIME in names for names in unknown))
    if not (found or raw) or "columns of kind" in str(error):
        return error
    entries = [*(source for source in good.values() if not source.plain), *found]
    words = "reads it, if it is what is meant" if not raw else "is what it would take, with yours for the dots"
    with_table = ValueError(f"{error}; this table in the rig file {words}:")
    with_table.add_note("\n".join([toml_lines(entries), *raw]))
    return with_table


def _record(
    name: str,
    where: str,
    rig: Rig,
    table: CsvTable,
    sources: Mapping[str, MappedColumn],
    driven_only: bool,
    lenient: bool = False,
    row_name: str = "line",
) -> Record:
    """The record of a table with our columns at their `sources`, checked row by row."""
    name, where = text_of(name), text_of(where)
    raw = dict(zip(table.header, table.values.T, strict=True))
    ours = {
        target: s.values(raw[s.column] if s.column else table.lines, table.units.get(s.column, ""))
        for target, s in sources.items()
    }
    read = {source.column for source in sources.values()}
    kind = kind_of(rig, {*sources, *(key for key in table.header if key not in read)})
    further = {key: raw[key].copy() for key in table.header if key and key not in read and not np.isnan(raw[key]).all()}
    columns = {**ours, **{key: values for key, values in further.items() if key not in ours}}
    if all(source.plain for source in sources.values()):
        columns = {key: columns[key] for key in table.header if key in columns}
    free = [name for name in _free(kind) if name in ours]
    strange = [n for n in free if contradiction(n, sources[n], table.units) or not _usable(kind, n, ours[n])]
    columns = {key: values for key, values in columns.items() if key not in strange}
    layout = kind.columns(ours)
    optional = [name for name in layout.optional if name not in ours]
    foreign = [key for key in further if key not in ours and any(nearly(key, name) for name in optional)]
    foreign += [key for key in table.header if kind.stage and key.startswith(_LOADED) and key not in (*read, *foreign)]
    names = list(dict.fromkeys((*optional, *_free(kind))))
    unused = tuple(TEXT("left_out", where=where, column=name, names=names) for name in (*strange, *foreign))
    lines, lost = table.lines, tuple[LeftOut, ...]()
    if kind.layout.time:
        columns, lines, lost = _on_rising_stamps(where, columns, lines, row_name)
        columns, lines, paced, more = _on_one_clock(where, kind, columns, lines, row_name)
        unused, lost = (*unused, *paced), (*lost, *more)
    rows = len(lines)
    _refuse_wrong(where, kind, columns, lines, lenient, row_name)
    least = (2 if kind.layout.time else 1) if driven_only else kind.layout.minimum
    if rows < least:
        raise ValueError(f"{where}: record of kind {kind.id} must have at least {least} rows; got {rows}")
    for key in (key for key in _sparse(kind) if key in ours):
        alone = not columns.keys() & {*kind.layout.beside}  # an accelerometer shows what lies between rare images
        columns |= kept_between(where, key, columns[key], least if alone else 2)
    if "velocity_m_s" in kind.layout.given_by_rig and "velocity_m_s" not in columns:
        if rig.velocity_m_s is None:
            raise ValueError(f"{where}: velocity_m_s must be a column of the record or a key under [rig]; got neither")
        columns["velocity_m_s"] = np.full(rows, rig.velocity_m_s)
    columns, notes = directed(kind, columns, rig)
    return Record(name, kind.id, columns, where, lines, (*unused, *notes), left_out=lost)


def _on_rising_stamps(
    where: str, columns: dict[str, Array], lines: NDArray[np.int64], row_name: str
) -> tuple[dict[str, Array], NDArray[np.int64], tuple[LeftOut, ...]]:
    """The rows without single ones that have no stamp, or one that does not fit between the others, and what was left
    out; stamps that are differences become their sums. All rows where more is wrong. Raises ValueError.
    """
    t = columns[TIME]
    none = np.isnan(t)
    if none.sum() > ASTRAY * len(t):
        raise ValueError(
            f"{where}, {row_name} {lines[np.argmax(none)]}: t_s must be a finite number; got none in {none.sum()} of"
            f" {len(t)} rows"
        )
    if are_differences(t):
        return {**columns, TIME: np.cumsum(t)}, lines, (left_out("differences", TIME, t[:0], len(t)),)
    kept, back = in_order(t)
    if kept.all() or back:
        return columns, lines, ()
    lost = np.flatnonzero(~kept)
    same = np.diff(t) == 0
    doubled = bool((np.append(same, False) | np.append(False, same))[lost].all())
    case = "stamps_repeated" if doubled else "stamps_astray"
    places = [f"{row_name} {line}" for line in lines[lost]]
    told = left_out(case, TIME, t[lost], len(t), places=places)
    return {name: values[kept] for name, values in columns.items()}, lines[kept], (told,)


def _on_one_clock(
    where: str, kind: RigKind, columns: dict[str, Array], lines: NDArray[np.int64], row_name: str
) -> tuple[dict[str, Array], NDArray[np.int64], tuple[str, ...], tuple[LeftOut, ...]]:
    """A table in which a driven column is empty where others are not holds columns with clocks of their own: ours at
    the rows of the measured one (`one_clock`), notes on it, and what was left out. Raises ValueError.
    """
    t, ours = columns[TIME], [name for name in columns if name in kind.known and name != TIME]
    there = {name: np.isfinite(columns[name]) for name in ours}
    empty = [name for name in ours if name in _paced(kind) and not there[name].all()]
    if not empty or np.any(np.diff(t) <= 0):
        return columns, lines, (), ()
    rows_of = next((name for name in kind.columns(columns).measured if name in there), empty[0])
    lost = list[LeftOut]()
    for name in (name for name in empty if (there[rows_of] & there[name]).any()):
        gone = np.flatnonzero(there[rows_of] & ~there[name])
        places = [f"{row_name} {line}" for line in lines[gone[:3]]]
        lost += [left_out("no_number", name, t[gone], len(t), places=places)] if len(gone) else []
    try:
        samples = {name: (t[there[name]], columns[name][there[name]]) for name in ours}
        made, notes, more = one_clock(samples, rows_of, SWITCHES)
    except ClockError as error:
        raise ValueError(f"{where}: {error}") from None
    return made, lines[np.searchsorted(t, made[TIME]).clip(max=len(t) - 1)], notes, (*lost, *more)


def _refuse_wrong(
    where: str,
    kind: RigKind,
    columns: Mapping[str, Array],
    lines: NDArray[np.int64],
    lenient: bool,
    row_name: str,
) -> None:
    """Refuse falling stamps, values out of range (`lenient`: too large for the checks), and valleys above peaks."""

    def refuse(wrong: NDArray[np.bool_], rule: str, *values: Array) -> None:
        if wrong.any():
            row = int(np.argmax(wrong))
            raise ValueError(f"{where}, {row_name} {lines[row]}: {rule.format(*(one[row] for one in values))}")

    if kind.layout.time and not lenient:
        time, before = columns[TIME], np.append(-np.inf, columns[TIME][:-1])
        refuse(~(time > before), "t_s must increase; got {:.12g} after {:.12g}", time, before)
    for name, values in columns.items():
        limits = kind.range(name) if name in kind.known else None
        if limits is not None:
            wrong = ~limits.holds(values) & (not lenient or np.abs(values) > LARGEST_SAMPLE)
            refuse(wrong, f"{name} must be {limits.words}; got {{:g}}", values)
    if kind.rising is not None and set(kind.rising) <= columns.keys():
        low, high = (columns[name] for name in kind.rising)
        rule = f"{kind.rising[1]} must be above {kind.rising[0]}; got {{:g}} and {{:g}}"
        refuse(~(high > low), rule, high, low)
