"""Records as they are: a panel for each column."""

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from hil.report.theme import axes, line, line_look
from hil.report.words import column_words
from models.records.record import Record
from models.words.sentences import listed


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
