"""Figures of a record: measured against predicted, what each model leaves, and the motion of a proposed one."""

from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from hil.report.panels import Array, Panel
from hil.report.theme import INK, STAGE_COLOURS, axes, styled, thinned
from hil.report.words import column_words
from models.identification.finding import Proposal
from models.words.quantities import scale


def trace_figure(panel: Panel, points: int, residual: bool = True) -> go.Figure:
    """Measured and predicted over the record's abscissa; below, what the models after the nominal one leave."""
    factor, unit = scale([*panel.measured, *(v for values in panel.predicted.values() for v in values)], panel.unit)
    heights = [0.68, 0.32][: 1 + residual]
    figure = make_subplots(rows=len(heights), cols=1, shared_xaxes=True, vertical_spacing=0.06, row_heights=heights)
    if panel.dense:
        lines = [(stage, STAGE_COLOURS[stage], values) for stage, values in panel.predicted.items()]
        lines.insert(2, ("measured", INK, panel.measured))
        for name, colour, values in lines:
            _line(figure, panel, factor * values, name, colour, points)
    else:
        _markers(figure, panel, factor)
    if residual:
        for stage, values in panel.predicted.items():
            if stage != "nominal" or len(panel.predicted) == 1:
                _rest(figure, panel, stage, factor * (panel.measured - values), points)
    name, axis_unit = column_words(panel.axis)
    styled(figure, 420 if residual else 300)
    figure.update_xaxes(title=f"{name} in {axis_unit}" if axis_unit else name, row=1 + residual)
    figure.update_yaxes(title=f"{panel.quantity} in {unit}", row=1, col=1)
    return figure.update_yaxes(title="residual", row=2, col=1) if residual else figure


def motion_figure(proposal: Proposal) -> go.Figure:
    """The waypoints of `proposal`, in mm over s."""
    line = {"color": STAGE_COLOURS["augmented"], "width": 2}
    look: dict[str, Any] = {"mode": "lines+markers", "line": line, "marker": {"size": 5}, "showlegend": False}
    hover = "%{x:.2f} s: %{y:.3f} mm<extra></extra>"
    figure = axes("time in s", f"{column_words(proposal.column)[0]} in mm", 260)
    return figure.add_scatter(x=proposal.times_s, y=1e3 * proposal.places_m, hovertemplate=hover, **look)


def _line(figure: go.Figure, panel: Panel, values: Array, name: str, colour: str, points: int) -> None:
    x, y = thinned(panel.abscissa, values, points)
    line = {"color": colour, "width": 1.2}
    figure.add_scatter(x=x.astype(np.float32), y=y.astype(np.float32), name=name, mode="lines", line=line, row=1, col=1)


def _markers(figure: go.Figure, panel: Panel, factor: float) -> None:
    symbols = {"nominal": "x-thin", "calibrated": "diamond", "augmented": "circle"}
    order = np.argsort(panel.abscissa, kind="stable")
    here: dict[str, Any] = {"x": panel.abscissa[order], "mode": "markers", "row": 1, "col": 1}
    for stage, values in panel.predicted.items():
        edge = {"color": STAGE_COLOURS[stage], "width": 2 if stage == "nominal" else 0}
        marker = {"color": STAGE_COLOURS[stage], "symbol": symbols[stage], "size": 9, "line": edge}
        figure.add_scatter(y=factor * values[order], name=stage, marker=marker, **here)
    marker = {"color": "white", "size": 9, "line": {"color": INK, "width": 2}}
    figure.add_scatter(y=factor * panel.measured[order], name="measured", marker=marker, **here)


def _rest(figure: go.Figure, panel: Panel, stage: str, values: Array, points: int) -> None:
    colour = STAGE_COLOURS[stage]
    x, y = thinned(panel.abscissa, values, points) if panel.dense else (panel.abscissa, values)
    style: dict[str, Any] = {
        "mode": "lines" if panel.dense else "markers",
        "name": f"left by {stage}",
        "showlegend": False,
    }
    style |= {"line": {"color": colour, "width": 1}} if panel.dense else {"marker": {"color": colour, "size": 7}}
    figure.add_scatter(x=x.astype(np.float32), y=y.astype(np.float32), row=2, col=1, **style)
