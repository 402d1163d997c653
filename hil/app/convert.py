"""`capsule convert`: records and logs of any readable kind to CSV, Parquet, MF4 or MCAP."""

import gzip
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

from hil.app.console import TEXT, answer, note, printable
from hil.app.scenario.rig_file import read_deployed_rig
from hil.app.shared_options import Json, argument, option
from hil.app.write import check_file, check_folder, check_targets, table_text, write_files
from hil.formats.channels import Channel, Heading, by_clock, one_table, refusing
from hil.formats.reading import WRITTEN, is_log, write_channels
from hil.log.record import file_channels
from hil.log.rig_record import read_rig_record
from models.files.toml import check_word
from models.files.units import split_unit, unit_of
from models.records.clock import in_order, left_out
from models.records.record import as_measured
from models.rigs.columns import TIME
from models.rigs.kinds import KINDS
from models.rigs.rig import Rig

_SHOWN: Final = 8  # columns in a line
_TABLES: Final = (".csv", ".csv.gz")
_ROWS: Final = (*_TABLES, ".parquet")
ENDINGS: Final = (*_TABLES, *WRITTEN)


@dataclass(frozen=True)
class Converted:
    """One file converted: its channels, and notes on how they were read as a record."""

    path: Path
    out: Path
    channels: list[Channel]
    notes: tuple[str, ...] = ()

    @property
    def rows(self) -> int:
        return max(len(channel.values) for channel in self.channels)


def convert(
    paths: Annotated[list[Path], argument("IN", reads="record")],
    out: Annotated[str, argument("OUT")],
    rig: Annotated[Path | None, option("--rig", "RIG.toml", reads="rig file")] = None,
    kind: Annotated[str | None, option("--kind", "KIND")] = None,
    json_output: Json = False,
) -> None:
    """Write all files or none: with a rig or kind the columns as close-loop reads them, else all channels."""
    targets = _targets(paths, out)
    check_targets(list(targets.values()), "OUT", [path for path in [*paths, *([rig] if rig else [])] if path.is_file()])
    belief = _belief(rig, kind)
    done = [_converted(path, target, belief) for path, target in targets.items()]
    write_files({one.out: _content(one) for one in done})
    for one in done:
        for words in one.notes:
            note(f"{one.path}: {words}")
    answer(json_output, {"files": [_document(one) for one in done]}, *map(_line, done))


def _targets(paths: Sequence[Path], out: str) -> dict[Path, Path]:
    folder = out.endswith(("/", os.sep)) or Path(out).is_dir()
    if len(paths) > 1 and not folder:
        raise ValueError(f"OUT must be a folder, existing or with a name that ends in /, for several files; got {out}")
    if not folder:
        return {paths[0]: check_file(Path(out), "OUT", ENDINGS)}
    check_folder(Path(out), "OUT")
    targets = {path: Path(out) / f"{Path(path.name.removesuffix('.gz')).stem}.csv" for path in paths}
    for path, target in targets.items():
        if list(targets.values()).count(target) > 1:
            raise ValueError(f"file names must differ without their endings; got {path.name} and another")
    return targets


def _belief(rig: Path | None, kind: str | None) -> Rig | None:
    if kind is not None:
        check_word(kind, "--kind", KINDS)
    if rig is None:
        return None if kind is None else Rig(kind)
    belief = read_deployed_rig(rig)
    if kind not in (None, belief.kind):
        raise ValueError(f"--kind must be that of {rig}, {belief.kind}, or be left out; got {kind}")
    return belief


def _converted(path: Path, out: Path, rig: Rig | None) -> Converted:
    if rig is None:
        notes: list[str] = []
        channels = file_channels(path, notes.append)
        if out.name.lower().endswith(_ROWS):
            channels = [_rising(one, notes) for one in channels]
        return Converted(path, out, channels, tuple(notes))
    record = read_rig_record(path, rig)
    channels = [Channel(Heading(name, unit_of(name)), values) for name, values in as_measured(record).items()]
    return Converted(path, out, channels, record.said)


def _rising(channel: Channel, notes: list[str]) -> Channel:
    """A channel without single samples whose stamps do not fit between the others, which the rows of a table do."""
    if channel.time_s is None or (kept := in_order(channel.time_s)[0]).all():
        return channel
    name, times = channel.heading.name, channel.time_s
    notes.append(left_out("stamps_astray", name, times[~kept], len(times)).sentence)
    return Channel(channel.heading, channel.values[kept], times[kept])


def _content(one: Converted) -> bytes:
    if not one.out.name.lower().endswith(_TABLES):
        return write_channels(one.out, one.channels)
    clocks = [] if is_log(one.path) else by_clock([c for c in one.channels if c.time_s is not None])
    if len({len(times) for _, times, _ in clocks}) > 1 or any((times != clocks[0][1]).any() for _, times, _ in clocks):
        raise ValueError(
            f"{one.path}: channels must have one clock to become rows of a CSV file; got {len(clocks)}: choose one by"
            f" --rig or --kind, or an OUT that ends in {', '.join(WRITTEN)}"
        )
    titles = {channel.heading.name: _title(channel.heading) for channel in one.channels}
    with refusing(one.path, "one that can become a table"):
        table = {titles.get(name, name): column for name, column in one_table(one.channels).items()}
    head, end, rows = table_text(table).partition("\n")
    data = f"{head}{end}{rows.replace('nan', '')}".encode()
    return gzip.compress(data, mtime=0) if one.out.name.lower().endswith(".gz") else data


def _title(heading: Heading) -> str:
    name = " ".join(printable(heading.name).split())
    return f"{name} [{printable(heading.unit)}]" if heading.unit and not split_unit(name)[1] and name != TIME else name


def _line(one: Converted) -> str:
    names = [channel.heading.name for channel in one.channels]
    shown = names[:_SHOWN] + ([TEXT("convert.more", count=len(names) - _SHOWN)] if len(names) > _SHOWN else [])
    return TEXT("convert.done", path=one.path, out=one.out, rows=one.rows, count=len(names), names=shown)


def _document(one: Converted) -> dict[str, object]:
    return {
        "from": str(one.path),
        "to": str(one.out),
        "rows": one.rows,
        "columns": [channel.heading.name for channel in one.channels],
        "notes": list(one.notes),
    }
