"""Figures of records: measured and predicted, the residuals, the columns as they are, and a proposed motion."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go

from hil.report.panels import Panel, largest
from hil.report.theme import INK, STAGE_COLOURS, axes, line, line_look
from hil.report.words import column_words
from models.identification.finding import Proposal
from models.records.record import Record
from models.words.quantities import scale
from models.words.sentences import listed


def trace_figure(panel: Panel, points: int, residual: bool = True) -> go.Figure:
    """Measured and predicted over the record's abscissa; below, the residuals of the models after the nominal one."""
    factor, unit = scale(map(largest, (panel.measured, *panel.predicted.values())), panel.unit)
    titles = [f"{panel.quantity} in {unit}", f"residual in {unit}"][: 1 + residual]
    name, axis_unit = column_words(panel.axis)
    x = f"{name} in {axis_unit}" if axis_unit else name
    figure = axes(x, titles, 420 if residual else 300, row_heights=[0.68, 0.32][: 1 + residual])
    if panel.dense:
        lines = [(stage, STAGE_COLOURS[stage], values) for stage, values in panel.predicted.items()]
        lines.insert(2, ("measured", INK, panel.measured))
        for name, colour, values in lines:
            line(figure, panel.abscissa, factor * values, name, {"color": colour, "width": 1.2}, points=points)
    else:
        _markers(figure, panel, factor)
    for stage, values in panel.predicted.items() if residual else ():
        if stage != "nominal" or len(panel.predicted) == 1:
            look, rest = {"color": STAGE_COLOURS[stage], "width": 1}, factor * (panel.measured - values)
            shown: dict[str, Any] = {} if panel.dense else {"mode": "markers", "marker": {"size": 7}}
            line(figure, panel.abscissa, rest, f"residual, {stage}", look, 2, points=points, **shown)
    return figure


def motion_figure(proposal: Proposal) -> go.Figure:
    """The waypoints of `proposal`, in mm over s."""
    line = {"color": STAGE_COLOURS["augmented"], "width": 2}
    look: dict[str, Any] = {"mode": "lines+markers", "line": line, "marker": {"size": 5}, "showlegend": False}
    hover = "%{x:.2f} s: %{y:.3f} mm<extra></extra>"
    path = proposal.column if proposal.column.endswith("_m") else "position_m"
    figure = axes("time in s", f"{column_words(path)[0]} in mm", 260)
    return figure.add_scatter(x=proposal.times_s, y=1e3 * proposal.places_m, hovertemplate=hover, **look)


def _markers(figure: go.Figure, panel: Panel, factor: float) -> None:
    symbols = {"nominal": "x-thin", "calibrated": "diamond", "augmented": "circle"}
    order = np.argsort(panel.abscissa, kind="stable")
    here: dict[str, Any] = {"x": panel.abscissa[order], "mode": "markers", "row": 1, "col": 1}
    for stage, values in panel.predicted.items():
        edge = {"color": STAGE_COLOURS[stage], "width": 2 if stage == "nominal" else 0}
        marker = {"color": STAGE_COLOURS[stage], "symbol": symbols[stage], "size": 9, "line": edge}
        figure.add_scatter(y=factor * values[order], name=stage, legendgroup=stage, marker=marker, **here)
    marker = {"color": "white", "size": 9, "line": {"color": INK, "width": 2}}
    figure.add_scatter(y=factor * panel.measured[order], name="measured", legendgroup="measured", marker=marker, **here)


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
