"""The builder of every page: a template puts a header, sections and figures on one self-contained file, with the style
and a packed plotly of less than a MB.
"""

import base64
import math
import re
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
import plotly.io as pio
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from hil.report import words
from hil.report.mathml import equations_html
from models import effects
from models.words import quantities, sentences

TEMPLATES = Path(__file__).with_name("templates")
PLOTLY = Path(__file__).parent / "plotly" / "plotly-cartesian.min.js.gz"
"""The file of npm's plotly.js-cartesian-dist-min as it is published, gzipped: bars, boxes, heat maps, lines and
points. It is a third of the whole library, which a browser takes over a second to read.
"""


@cache
def environment(folder: Path = TEMPLATES) -> Environment:
    made = Environment(
        loader=FileSystemLoader(folder),
        autoescape=lambda name: name is None or ".html" in name,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    for room, names in (
        (quantities, ("number", "fixed", "percent", "amount", "quantity", "unit_words")),
        (words, ("column_words", "parameter_words")),
        (effects, ("effect_words",)),
        (sentences, ("listed", "sentence")),
    ):
        made.filters |= {name: getattr(room, name) for name in names}
    made.filters |= {"equations": equations_html, "exp": math.exp}
    # a sentence with its indexed letters, as in F_e, typeset; a path or name that may go on in the next line
    made.filters["indexed"] = partial(_put, r"\b([A-Za-z])_([A-Za-z])\b", r"<i>\1</i><sub>\2</sub>")
    made.filters["breakable"] = partial(_put, r"([/_])", r"\1<wbr>")
    made.globals |= {"DASH": quantities.DASH, "library": cache(lambda: base64.b64encode(PLOTLY.read_bytes()).decode())}
    return made


def _put(pattern: str, markup: str, text: str) -> Markup:
    return Markup(re.sub(pattern, markup, str(escape(text))))


class _Parts:
    def __init__(self) -> None:
        self.head: dict[str, Any] = {}
        self.sections: list[tuple[str, str, str]] = []
        self.figures = 0

    def header(
        self, title: str, eyebrow: str, lead: str = "", kind: str = "", style: str = "", caller: Any = None
    ) -> str:
        """The header: eyebrow, title and a sentence, the caller's HTML below; `style` names a further style sheet."""
        self.head = {"title": title, "eyebrow": eyebrow, "lead": lead, "kind": kind, "style": style}
        self.head["more"] = "" if caller is None else caller()
        return ""

    def section(self, key: str, title: str, caller: Callable[[], str]) -> str:
        """A section, omitted where it is empty; `key` names its link at the top."""
        content = caller()
        if content.strip():
            self.sections.append((key, title, content))
        return ""

    def figure(self, figure: go.Figure | None) -> str:
        """A figure, drawn once it comes into view; panels side by side, and names beside bars, have a least width."""
        if figure is None:
            return ""
        self.figures += 1
        columns = {trace.xaxis or "x" for trace in figure.data if hasattr(trace, "xaxis")}
        beside = len({getattr(figure.layout, f"xaxis{axis[1:]}").domain for axis in columns}) if columns else 1
        named = any(trace.orientation == "h" for trace in figure.data if hasattr(trace, "orientation"))
        return Markup(
            '<div class="figure" tabindex="0"><div{}><div class="plot" id="figure-{}" style="height: {}px"></div>'
            '<script type="application/json">{}</script></div></div>'
        ).format(
            Markup(' style="min-width: 640px"') if beside > 1 or named else "",
            self.figures,
            int(figure.layout.height or 420),
            Markup(str(pio.to_json(figure, validate=False)).replace("<", "\\u003c")),
        )


def page(template: str, **records: Any) -> str:
    """The page that `template` makes of plain `records`, complete in itself."""
    parts = _Parts()
    own = {"header": parts.header, "section": parts.section, "figure": parts.figure}
    environment().get_template(template).render(**own, **records)
    frame = environment().get_template("page.html.j2")
    return frame.render(**parts.head, sections=parts.sections, drawn=bool(parts.figures))
