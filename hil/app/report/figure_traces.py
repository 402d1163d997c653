"""Figures of a record: measured against predicted, and what each model leaves."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from hil.app.quantities import scale
from hil.app.report.panels import Array, Panel, thinned
from hil.app.report.theme import INK, STAGE_COLOURS, styled
from hil.app.report.words import STAGE_WORDS, column_words


def trace_figure(panel: Panel, points: int, residual: bool = True) -> go.Figure:
    """Measured and predicted over the record's abscissa; below, what the models after the nominal one leave."""
    factor, unit = scale([*panel.measured, *(v for values in panel.predicted.values() for v in values)], panel.unit)
    figure = make_subplots(
        rows=2 if residual else 1,
        cols=1,
        shared_xaxes=True,
        vertical_spacing=0.06,
        row_heights=[0.68, 0.32][: 1 + residual],
    )
    if panel.dense:
        lines = [(STAGE_WORDS[stage], STAGE_COLOURS[stage], values) for stage, values in panel.predicted.items()]
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


def _line(figure: go.Figure, panel: Panel, values: Array, name: str, colour: str, points: int) -> None:
    x, y = thinned(panel.abscissa, values, points)
    line = {"color": colour, "width": 1.2}
    figure.add_scatter(x=x.astype(np.float32), y=y.astype(np.float32), name=name, mode="lines", line=line, row=1, col=1)


def _markers(figure: go.Figure, panel: Panel, factor: float) -> None:
    symbols = {"nominal": "x-thin", "calibrated": "diamond", "augmented": "circle"}
    order = np.argsort(panel.abscissa, kind="stable")
    x = panel.abscissa[order]
    for stage, values in panel.predicted.items():
        colour = STAGE_COLOURS[stage]
        marker = {
            "color": colour,
            "symbol": symbols[stage],
            "size": 9,
            "line": {"color": colour, "width": 2 if stage == "nominal" else 0},
        }
        figure.add_scatter(
            x=x, y=factor * values[order], name=STAGE_WORDS[stage], mode="markers", marker=marker, row=1, col=1
        )
    marker = {"color": "white", "size": 9, "line": {"color": INK, "width": 2}}
    figure.add_scatter(
        x=x, y=factor * panel.measured[order], name="measured", mode="markers", marker=marker, row=1, col=1
    )


def _rest(figure: go.Figure, panel: Panel, stage: str, values: Array, points: int) -> None:
    colour = STAGE_COLOURS[stage]
    x, y = thinned(panel.abscissa, values, points) if panel.dense else (panel.abscissa, values)
    style = (
        {"mode": "lines", "line": {"color": colour, "width": 1}}
        if panel.dense
        else {"mode": "markers", "marker": {"color": colour, "size": 7}}
    )
    figure.add_scatter(
        x=x.astype(np.float32), y=y.astype(np.float32), name=f"left by {stage}", showlegend=False, row=2, col=1, **style
    )
