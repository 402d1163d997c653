"""Colours and the common look of the figures on all pages; in the dark the page's style exchanges them."""

from types import MappingProxyType
from typing import Any

import plotly.graph_objects as go
import plotly.io as pio

INK, MUTED, GRID, FLOOR = "#1d2733", "#66727f", "#e6eaee", "#8792a0"
STAGE_COLOURS = MappingProxyType({"nominal": "#a9b4c2", "calibrated": "#e0913a", "augmented": "#0b7a84"})
QUANTITY_COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#8a7d1a")
"""Okabe and Ito's colours, which people of every colour vision tell apart; the yellow one darker, for white paper."""
DASHES = ("solid", "dash", "dot", "dashdot")
SYMBOLS = ("circle", "diamond", "square", "triangle-up", "cross", "x", "star")
FONT = "Inter, 'Segoe UI', system-ui, -apple-system, 'Helvetica Neue', Arial, sans-serif"
ROOM_BELOW = 56
"""Of a figure, px: a tick, a label with a power and a title. Plotly draws a figure twice whose labels need more."""


def line_colour(number: int) -> str:
    """The colour of line `number` of many of one kind; they come again."""
    return QUANTITY_COLOURS[number % len(QUANTITY_COLOURS)]


def line_look(number: int) -> dict[str, Any]:
    """Colour and dash of line `number`: different for 28 lines."""
    return {"color": line_colour(number), "dash": DASHES[number // len(QUANTITY_COLOURS) % len(DASHES)]}


def symbol(number: int) -> str:
    """The marker of series `number`."""
    return SYMBOLS[number % len(SYMBOLS)]


def styled(figure: go.Figure, height: int, **layout: Any) -> go.Figure:
    """The figure in the pages' look."""
    figure.update_layout(
        template="none",
        height=height,
        font={"family": FONT, "size": 13, "color": INK},
        margin={"l": 70, "r": 20, "t": 34, "b": ROOM_BELOW},
        plot_bgcolor="rgba(0,0,0,0)",
        paper_bgcolor="rgba(0,0,0,0)",
        legend={"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom", "bgcolor": "rgba(0,0,0,0)"},
        hoverlabel={"font": {"family": FONT}},
    )
    axis = {"gridcolor": GRID, "linecolor": "#c6ced6", "title_standoff": 8, "automargin": True, "minexponent": 4}
    figure.update_xaxes(zeroline=False, ticks="outside", tickcolor="#c6ced6", exponentformat="power", **axis)
    figure.update_yaxes(zerolinecolor="#c6ced6", zerolinewidth=1, exponentformat="power", **axis)
    figure.update_annotations(font={"size": 13, "color": MUTED})
    figure.update_layout(**layout)
    return figure


def axes(figure: go.Figure, x: str, y: str, height: int, **layout: Any) -> go.Figure:
    """The figure in the pages' look, its axes titled."""
    return styled(figure, height, **layout).update_xaxes(title=x).update_yaxes(title=y)


def figure_html(figure: go.Figure, name: str) -> str:
    """The figure as a piece of a page, drawn once it comes into view; one with panels side by side has a least
    width.
    """
    columns = {trace.xaxis or "x" for trace in figure.data if hasattr(trace, "xaxis")}
    beside = len({getattr(figure.layout, f"xaxis{axis[1:]}").domain for axis in columns}) if columns else 1
    wide = ' style="min-width: 640px"' if beside > 1 else ""
    height = int(figure.layout.height or 420)
    text = str(pio.to_json(figure, validate=False)).replace("<", "\\u003c")
    return (
        f'<div class="figure" tabindex="0"><div{wide}><div class="plot" id="{name}" style="height: {height}px"></div>'
        f'<script type="application/json">{text}</script></div></div>'
    )
