"""`capsule plot`: records as one interactive page, a panel for each column over time or over the first column."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from hil.app.close_loop import read_series
from hil.app.console import answer
from hil.app.scenario.rig_file import read_deployed_rig
from hil.app.shared_options import Json, Records, option
from hil.app.write import check_file, check_targets, write_files
from hil.formats.channels import by_clock, one_table, refusing
from hil.log.record import file_channels
from hil.report import builder
from hil.report.figure_traces import columns_figure, names
from models.records.record import Record, as_measured
from models.rigs.columns import TIME


def plot(
    records: Records,
    rig: Annotated[Path | None, option("--rig", "RIG.toml", reads="rig file")] = None,
    out: Annotated[Path, option("--out", "PAGE.html")] = Path("records.html"),
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
    eyebrow = f"{len(records)} record{'s' * (len(records) > 1)}"
    drawn = columns_figure(records)
    return builder.page("plot.html.j2", title=names(records), eyebrow=eyebrow, lead="", heading="Columns", drawn=drawn)
