"""Colours and the common look of the figures on all pages; in the dark the page's style exchanges ink and paper."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

Array = NDArray[np.float64]
POINTS = 4000  # of a line

INK, MUTED, FAINT, GRID, FLOOR = "#1d2733", "#66727f", "#c6ced6", "#e6eaee", "#8792a0"
STAGE_COLOURS = MappingProxyType({"nominal": "#7d8a9a", "calibrated": "#c9741c", "augmented": "#0e8490"})
QUANTITY_COLOURS = ("#1a7fbe", "#b87a00", "#009e73", "#c06a99", "#7f68cc", "#d55e00", "#8a7d1a")
"""After Okabe and Ito's, distinguishable in every colour vision; all of a lightness that shows on white and on the dark
paper, at a contrast of 3 and more.
"""
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
    return SYMBOLS[number % len(SYMBOLS)]


def styled(figure: go.Figure, height: int, **layout: Any) -> go.Figure:
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
    axis = {"gridcolor": GRID, "linecolor": FAINT, "title_standoff": 8, "automargin": True, "minexponent": 4}
    figure.update_xaxes(zeroline=False, ticks="outside", tickcolor=FAINT, exponentformat="power", **axis)
    figure.update_yaxes(zerolinecolor=FAINT, zerolinewidth=1, exponentformat="power", **axis)
    figure.update_annotations(font={"size": 13, "color": MUTED})
    figure.update_layout(**layout)
    return figure


def axes(x: str, y: str | Sequence[str], height: int, spacing: float = 0.06, **layout: Any) -> go.Figure:
    """An empty figure with titled axes in the pages' look: one panel, or one below the other for several `y`."""
    titles = [y] if isinstance(y, str) else [*y]
    grid = {"row_heights": layout.pop("row_heights")} if "row_heights" in layout else {}
    figure = make_subplots(rows=len(titles), cols=1, shared_xaxes=True, vertical_spacing=spacing, **grid)
    for row, title in enumerate(titles, start=1):
        figure.update_yaxes(title_text=title, row=row, col=1)
    figure.update_xaxes(title_text=x, row=len(titles), col=1)
    return styled(figure, height, **layout)


def grid(rows: int, cols: int, below: float = 0.0, beside: float = 0.03, **more: Any) -> go.Figure:
    """Empty panels with shared ordinates, so far apart as shares of the figure."""
    return make_subplots(rows, cols, shared_yaxes=True, vertical_spacing=below, horizontal_spacing=beside, **more)


def line(figure: go.Figure, x: Array, y: Array, name: str, look: Mapping[str, Any], row: int = 1, **more: Any) -> None:
    """A line of the panel `row` with one entry for all panels in the legend; drawn in at most `points`."""
    x, y = thinned(x, y, more.pop("points", POINTS))
    shown = {"mode": "lines", "legendgroup": name, "showlegend": row == 1, "col": 1, **more}
    points = {"x": x.astype(np.float32), "y": y.astype(np.float32)}
    figure.add_scatter(**points, name=name, line={"width": 1.5, **look}, row=row, **shown)


def thinned(abscissa: Array, values: Array, points: int) -> tuple[Array, Array]:
    """At most `points` samples: the lowest and the highest of each stretch, in their order."""
    stretch = -(-2 * len(values) // points)
    if stretch <= 2:
        return abscissa, values
    count = len(values) // stretch
    blocks = np.where(np.isfinite(values[: count * stretch]), values[: count * stretch], 0.0).reshape(count, stretch)
    start = stretch * np.arange(count)
    keep = np.sort(np.concatenate((start + blocks.argmin(axis=1), start + blocks.argmax(axis=1), [0, len(values) - 1])))
    keep = np.unique(keep)
    return abscissa[keep], values[keep]
