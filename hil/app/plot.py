"""`capsule plot`: records as one interactive page, a panel a column over time (or over the first column of a table)."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np

from hil.app.console import print_json, say
from hil.app.identify.close_loop import read_series
from hil.app.report.document import document, heading
from hil.app.report.theme import figure_html, line_look, styled
from hil.app.report.words import column_words, listed
from hil.app.scenario.deployment import read_deployed_rig
from hil.app.shared_options import Json, Records, option
from hil.app.write import check_file, check_targets, write_files
from hil.formats.channels import refusing
from hil.formats.clock import by_clock, one_table
from hil.log.channels import file_channels
from models.records.record import Array, Record, as_measured
from models.rigs.columns import TIME

_MOST_POINTS: Final = 4000
"""Points that a line shows; more are drawn by the largest and the smallest of each stretch."""


def plot(
    records: Records,
    rig: Annotated[Path | None, option("--rig", "RIG.toml", "Its rig file; else all columns as they stand.")] = None,
    out: Annotated[Path, option("--out", "PAGE.html", "Where the page goes.")] = Path("records.html"),
    json_output: Json = False,
) -> None:
    """Draw records of a rig as close-loop reads them, else all columns of numbers as they stand in the files."""
    check_targets([check_file(out, "--out", (".html",))], "--out", [*records, *([rig] if rig else [])])
    if rig:
        read = [replace(r, columns=as_measured(r)) for r in read_series(records, (), read_deployed_rig(rig))[0]]
    else:
        read = [record for path in records for record in as_they_stand(path)]
    write_files({out: page(read)})
    if json_output:
        told = [{"name": record.name, "rows": len(record), "columns": list(record.columns)} for record in read]
        print_json({"page": str(out), "records": told})
    else:
        say(f"page: {out}")


def as_they_stand(path: Path) -> list[Record]:
    """All columns of numbers of a file, a record a clock. Raises ValueError of one sentence."""
    channels = file_channels(path)
    if all(channel.time_s is None for channel in channels):
        with refusing(path, "one that can be drawn"):
            return [Record(path.name, "", one_table(channels))]
    return [
        Record(f"{path.name} {group}".strip(), "", {TIME: times} | {c.heading.name: c.values for c in members})
        for group, times, members in by_clock(channels)
    ]


def page(records: Sequence[Record]) -> str:
    """The page of one kind's records: a panel a column, the records over each other."""
    from plotly.subplots import make_subplots

    over = "t_s" if all("t_s" in record.columns for record in records) else next(iter(records[0].columns))
    columns = [name for name in dict.fromkeys(name for r in records for name in r.columns) if name != over]
    figure: Any = make_subplots(rows=len(columns), cols=1, shared_xaxes=True, vertical_spacing=0.1 / len(columns))
    for number, record in enumerate(record for record in records if over in record.columns):
        look = line_look(number)
        for row, name in ((r, n) for r, n in enumerate(columns, start=1) if n in record.columns):
            there = np.isfinite(record[name])
            x, y = thinned(record[over][there], record[name][there])
            figure.add_scatter(
                x=x, y=y, name=record.name, legendgroup=record.name, showlegend=row == 1, line=look,
                mode="lines" if over == "t_s" else "markers", marker={"color": look["color"]}, row=row, col=1,
            )  # fmt: skip
    for row, name in enumerate(columns, start=1):
        figure.update_yaxes(title_text=_title(name), row=row, col=1)
    figure.update_xaxes(title_text=_title(over), row=len(columns), col=1)
    styled(figure, 120 + 240 * len(columns), legend={"y": 1 + 24 / (120 + 240 * len(columns))})
    title = listed(record.name for record in records[:3]) + (" and more" if len(records) > 3 else "")
    head = heading(f"{len(records)} record{'s' * (len(records) > 1)}", title)
    return document(title, head, [("columns", "Columns", figure_html(figure, "figure-1"))])


def _title(column: str) -> str:
    words, unit = column_words(column)
    return f"{words} in {unit}" if unit else words


def thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """At most about `_MOST_POINTS` of the points (x, y), which keep the largest and smallest y of every stretch."""
    if len(x) <= _MOST_POINTS:
        return x, y
    edges = np.linspace(0, len(x), _MOST_POINTS // 2 + 1).astype(int)
    kept = {0, len(x) - 1}
    for begin, end in pairwise(edges.tolist()):
        kept |= {begin + int(np.argmin(y[begin:end])), begin + int(np.argmax(y[begin:end]))}
    rows = np.array(sorted(kept))
    return x[rows], y[rows]
