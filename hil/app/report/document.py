"""The frame of every page: one self-contained file with its style, its figures, and plotly packed to under a MB."""

import base64
from collections.abc import Iterable, Sequence
from functools import cache
from html import escape
from pathlib import Path

STYLE, DRAWING = (Path(__file__).with_name(name) for name in ("style.css", "draw.js"))
PLOTLY = Path(__file__).parent / "plotly" / "plotly-cartesian.min.js.gz"
"""The file of npm's plotly.js-cartesian-dist-min as it is published, gzipped: bars, boxes, heat maps, lines and points,
a third of the whole library, which a browser takes over a second to read.
"""
_WITHOUT = "<noscript><p>The figures need JavaScript; the tables hold their numbers.</p></noscript>"


def document(title: str, header: str, sections: Iterable[tuple[str, str, str]]) -> str:
    """A page: `header` is HTML, `sections` are (key, title, HTML) in their order; keys name the links at the top."""
    parts = list(sections)
    links = "".join(f'<a href="#{escape(key)}">{escape(name)}</a>' for key, name, _ in parts)
    body = "".join(
        f'<section id="{escape(key)}"><h2>{escape(name)}</h2>{content}</section>' for key, name, content in parts
    )
    navigation = f"<nav>{links}</nav>" if len(parts) > 2 else ""
    drawn = any('class="plot"' in content for _, _, content in parts)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark"><link rel="icon" href="data:,">'
        f"<title>{escape(title)}</title><style>{STYLE.read_text(encoding='utf-8')}</style></head>"
        f"<body><main>{header}{_WITHOUT if drawn else ''}{navigation}{body}</main>{_library() if drawn else ''}"
        "</body></html>\n"
    )


def heading(eyebrow: str, title: str, story: str = "", kind: str = "", more: str = "") -> str:
    """The header of a page: what it is, its headline, a sentence; `more` is HTML below."""
    told = f'<p class="story">{escape(story)}</p>' if story else ""
    return (
        f'<header class="{escape(kind)}"><p class="eyebrow">{escape(eyebrow)}</p><h1>{escape(title)}</h1>'
        f"{told}{more}</header>"
    )


def table(head: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> str:
    """An HTML table; cells are HTML; the first `left` columns are words, the others numbers."""
    return mixed_table([(name, column < left) for column, name in enumerate(head)], rows)


def mixed_table(head: Sequence[tuple[str, bool]], rows: Iterable[Sequence[str]]) -> str:
    """An HTML table whose head tells of each column its name and whether it holds words; cells are HTML."""
    classes = ["word" if words else "" for _, words in head]
    header = "".join(f'<th class="{c}">{name}</th>' for c, (name, _) in zip(classes, head, strict=True))
    body = "".join(
        "<tr>" + "".join(f'<td class="{c}">{cell}</td>' for c, cell in zip(classes, row, strict=True)) + "</tr>"
        for row in rows
    )
    return f'<div class="scroll"><table><thead><tr>{header}</tr></thead><tbody>{body}</tbody></table></div>'


@cache
def _library() -> str:
    """Plotly, gzipped and in base64, and the script that unpacks it and draws the figures as they come into view."""
    packed = base64.b64encode(PLOTLY.read_bytes()).decode()
    return (
        f'<script type="application/gzip" id="plotly">{packed}</script>'
        f"<script>{DRAWING.read_text(encoding='utf-8')}</script>"
    )
