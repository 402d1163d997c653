"""`capsule plot`: records as one interactive page, a panel for each column over time or over the first column."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import plotly.graph_objects as go

from hil.app.close_loop import read_series
from hil.app.console import answer
from hil.app.scenario.rig_file import read_deployed_rig
from hil.app.shared_options import Json, Records, option
from hil.app.write import check_file, check_targets, write_files
from hil.formats.channels import refusing
from hil.formats.clock import by_clock, one_table
from hil.log.record import file_channels
from hil.report import builder
from hil.report.theme import axes, line, line_look
from hil.report.words import column_words
from models.records.record import Record, as_measured
from models.rigs.columns import TIME
from models.words.sentences import listed


def plot(
    records: Records,
    rig: Annotated[
        Path | None, option("--rig", "RIG.toml", "Their rig file; else all columns unchanged.", "rig file")
    ] = None,
    out: Annotated[Path, option("--out", "PAGE.html", "Where the page goes.")] = Path("records.html"),
    json_output: Json = False,
) -> None:
    """Draw records of a rig as close-loop reads them, else all numeric columns of the files."""
    check_targets([check_file(out, "--out", (".html",))], "--out", [*records, *([rig] if rig else [])])
    if rig:
        read = [replace(r, columns=as_measured(r)) for r in read_series(records, (), read_deployed_rig(rig))[0]]
    else:
        read = [record for path in records for record in unchanged(path)]
    write_files({out: page(read)})
    drawn = [{"name": record.name, "rows": len(record), "columns": list(record.columns)} for record in read]
    answer(json_output, {"page": str(out), "records": drawn}, f"page: {out}")


def unchanged(path: Path) -> list[Record]:
    """All numeric columns of a file, one record for each clock. Raises ValueError of one sentence."""
    channels = file_channels(path)
    if all(channel.time_s is None for channel in channels):
        with refusing(path, "one that can be drawn"):
            return [Record(path.name, "", one_table(channels))]
    return [
        Record(f"{path.name} {group}".strip(), "", {TIME: times} | {c.heading.name: c.values for c in members})
        for group, times, members in by_clock(channels)
    ]


def page(records: Sequence[Record]) -> str:
    """The page of records of one kind."""
    eyebrow = f"{len(records)} record{'s' * (len(records) > 1)}"
    drawn = columns_figure(records)
    return builder.page("plot.html.j2", title=names(records), eyebrow=eyebrow, lead="", heading="Columns", drawn=drawn)


def names(records: Sequence[Record]) -> str:
    """The names of the first records."""
    return listed(record.name for record in records[:3]) + (" and more" if len(records) > 3 else "")


def columns_figure(records: Sequence[Record]) -> go.Figure:
    """A panel for each column, a line for each record."""
    over = "t_s" if all("t_s" in record.columns for record in records) else next(iter(records[0].columns))
    columns = [name for name in dict.fromkeys(name for r in records for name in r.columns) if name != over]
    height = 120 + 240 * len(columns)
    figure = axes(_title(over), [*map(_title, columns)], height, spacing=0.1 / len(columns))
    figure.update_layout(legend={"y": 1 + 24 / height})
    mode = "lines" if over == "t_s" else "markers"
    for number, record in enumerate(record for record in records if over in record.columns):
        look = line_look(number)
        more = {"mode": mode, "marker": {"color": look["color"]}}
        for row, name in ((r, n) for r, n in enumerate(columns, start=1) if n in record.columns):
            there = np.isfinite(record[name])
            line(figure, record[over][there], record[name][there], record.name, look | {"width": None}, row, **more)
    return figure


def _title(column: str) -> str:
    words, unit = column_words(column)
    return f"{words} in {unit}" if unit else words
