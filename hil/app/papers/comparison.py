"""What the comparison with the papers consists of: rows of numbers, and figures with a caption."""

import re
from dataclasses import dataclass
from typing import Any, Final

import plotly.graph_objects as go
from numpy.typing import ArrayLike

from hil.report.theme import INK, styled
from models.files.toml import beside
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
ROWS: Final = beside(__file__, "rows.toml")
# how many of a unit an SI unit is
_PER_SI = {"1": 1.0, "%": 100.0, "s": 1.0, "mm": 1e3, "mm/s": 1e3, "mN": 1e3, "N": 1.0, "Pa": 1.0, "MPa": 1e-6}
COLOURS: Final = {"printed": "#0072b2", "derived": "#d55e00", "third": "#009e73", "fourth": "#cc79a7", "measured": INK}
MN: Final = 1e3  # in a newton


@dataclass(frozen=True)
class Row:
    """A number in `unit`: what the `paper` states, `computed` from its equations, `measured` where it is printed."""

    id: str
    quantity: str
    unit: str
    paper: float | None
    computed: float
    measured: float | None
    verdict: str
    note: str


def row(
    key: str,
    computed: float,
    *tail: object,
    paper: float | None = None,
    measured: float | None = None,
    own: str = "",
    differs: tuple[str, str, str] | None = None,
    **fill: Any,
) -> Row:
    """The `Row` of `rows.toml` (unit, verdict and note where it `differs`) from numbers in SI; `fill` goes into its
    sentences. Its id is `own`, else the key with the `tail`.
    """
    unit, verdict, note = differs or ROWS[key]
    shown = (None if value is None else float(value) * _PER_SI[unit] for value in (paper, computed, measured))
    stated, found, seen = shown
    said = TEXT(f"note.{note}", **fill) if note else ""
    name = own or "_".join([key, *map(slug, map(str, tail))])
    return Row(name, TEXT(f"quantity.{key}", **fill), unit, stated, found or 0.0, seen, verdict, said)


def at_speed(speed_m_s: float) -> str:
    return f"{speed_m_s * 1e3:g} mm/s"


def slug(words: str) -> str:
    """Words as a part of an id: `0.5 mm/s` becomes `0_5_mm_s`."""
    return re.sub(r"\W", "_", words.lower())


@dataclass(frozen=True)
class Drawing:
    title: str
    caption: str
    figure: Any


class Plot:
    def __init__(self, x: str, y: str, height: int = 420, **layout: Any) -> None:
        self.figure: Any = styled(go.Figure(), height, margin={"l": 64, "r": 24, "t": 16, "b": 56})
        self.figure.update_layout(legend={"orientation": "h", "y": -0.22, "yanchor": "top", "x": 0}, **layout)
        self.figure.update_xaxes(title=x).update_yaxes(title=y)

    def line(self, x: ArrayLike, y: ArrayLike, name: str, colour: str, dash: str = "solid", **panel: int) -> None:
        look = {"color": COLOURS.get(colour, colour), "dash": dash, "width": 2}
        self.figure.add_scatter(x=x, y=y, name=name, mode="lines", line=look, **panel)

    def points(self, x: ArrayLike, y: ArrayLike, name: str, symbol: str = "circle", **options: Any) -> None:
        marker = {"color": options.pop("colour", INK), "size": 9, "symbol": symbol}
        edge = {"line": {"color": "white", "width": 1}}
        self.figure.add_scatter(x=x, y=y, name=name, mode="markers", marker=marker | edge, **options)

    def captioned(self, key: str, **values: Any) -> Drawing:
        """The figure under the title and over the caption `key`, which `values` go into."""
        return Drawing(TEXT(f"title.{key}"), TEXT(f"caption.{key}", **values), self.figure)
