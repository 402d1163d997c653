"""What every figure of the papers shares: palette, axes, lines and points."""

from dataclasses import dataclass
from typing import Any

import plotly.graph_objects as go
from numpy.typing import ArrayLike

from hil.report.theme import INK, styled

PRINTED, DERIVED, MEASURED, THIRD, FOURTH = "#0072b2", "#d55e00", INK, "#009e73", "#cc79a7"


@dataclass(frozen=True)
class Drawing:
    """One figure with its heading and the sentence beneath it."""

    title: str
    caption: str
    figure: Any


def axes(x: str, y: str, **layout: Any) -> Any:
    """An empty figure with titled axes."""
    figure = styled(go.Figure(), 420, margin={"l": 64, "r": 24, "t": 16, "b": 56})
    figure.update_layout(legend={"orientation": "h", "y": -0.22, "yanchor": "top", "x": 0}, **layout)
    figure.update_xaxes(title=x)
    return figure.update_yaxes(title=y)


def line(figure: Any, x: ArrayLike, y: ArrayLike, name: str, colour: str, dash: str = "solid", **where: Any) -> None:
    """Add a curve."""
    figure.add_trace(
        go.Scatter(x=x, y=y, name=name, mode="lines", line={"color": colour, "dash": dash, "width": 2}), **where
    )


def points(
    figure: Any, x: ArrayLike, y: ArrayLike, name: str, symbol: str = "circle", colour: str = MEASURED, **options: Any
) -> None:
    """Add markers, by default those of a measurement; `options` go to the trace, `row` and `col` to its place."""
    where = {key: options.pop(key) for key in ("row", "col") if key in options}
    marker = {"color": colour, "size": 9, "symbol": symbol, "line": {"color": "white", "width": 1}}
    figure.add_trace(go.Scatter(x=x, y=y, name=name, mode="markers", marker=marker, **options), **where)
