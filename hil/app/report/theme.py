"""Colours and the common look of the report's figures."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

import plotly.graph_objects as go
import plotly.io as pio

INK, MUTED, GRID, FLOOR = "#1d2733", "#66727f", "#e6eaee", "#8792a0"
STAGE_COLOURS = MappingProxyType({"nominal": "#a9b4c2", "calibrated": "#e0913a", "augmented": "#0b7a84"})
QUANTITY_COLOURS = ("#0b7a84", "#b5527a", "#6a7fc1", "#8a8f3c")
_LINE_COLOURS = (*QUANTITY_COLOURS, "#c2703d", "#4f9d69", "#b03a2e", "#7d8ca3")
FONT = "Inter, 'Segoe UI', system-ui, -apple-system, 'Helvetica Neue', Arial, sans-serif"


def line_colour(number: int) -> str:
    """The colour of line `number` of many of one kind; they come again."""
    return _LINE_COLOURS[number % len(_LINE_COLOURS)]


def styled(figure: go.Figure, height: int, **layout: Any) -> go.Figure:
    """The figure in the report's look."""
    figure.update_layout(
        template="none",
        height=height,
        font={"family": FONT, "size": 13, "color": INK},
        margin={"l": 70, "r": 20, "t": 34, "b": 52},
        plot_bgcolor="white",
        paper_bgcolor="white",
        legend={"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom", "bgcolor": "rgba(255,255,255,0)"},
        hoverlabel={"font": {"family": FONT}},
    )
    figure.update_xaxes(
        gridcolor=GRID, zeroline=False, linecolor="#c6ced6", ticks="outside", tickcolor="#c6ced6", title_standoff=8
    )
    figure.update_yaxes(gridcolor=GRID, zerolinecolor="#c6ced6", zerolinewidth=1, title_standoff=8, automargin=True)
    figure.update_annotations(font={"size": 13, "color": MUTED})
    figure.update_layout(**layout)
    return figure


def figure_html(figure: go.Figure, name: str) -> str:
    """The figure as a piece of the page; plotly itself stands there once."""
    config = {"displayModeBar": False, "responsive": True}
    html: str = pio.to_html(figure, config=config, include_plotlyjs=False, full_html=False, div_id=name)
    return html
