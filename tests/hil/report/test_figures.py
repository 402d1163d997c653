"""Every axis of every figure says what it is and in which unit; every colour shows on the paper of both schemes."""

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest

from hil.report.builder import TEMPLATES
from hil.report.closed_loop import report_html
from hil.report.theme import FLOOR, MUTED, QUANTITY_COLOURS, STAGE_COLOURS
from tests.hil.app.page_makers import campaign_page, demo_page
from tests.hil.findings import left_finding, pull_finding, spectrum_finding, table_finding

PURE = {
    "records",
    "duty",
    "drop of ln L",
    "gain, ln of a ratio",
    "hoop factor",
    "friction coefficient",
    "depth",
    "sample",
}
"""Titles of pure numbers and of names."""
PAGES = {
    "report": lambda: report_html(pull_finding(seconds=2.0)),
    "left": lambda: report_html(left_finding()),
    "table": lambda: report_html(table_finding()),
    "spectrum": lambda: report_html(spectrum_finding()),
    "campaign": campaign_page,
    "demo": demo_page,
}


def axes_of(page: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Each axis of numbers that is read in a figure of `page`, by its place; one of names needs no title."""
    figures = re.findall(r'<script type="application/json">(.*?)</script>', page, flags=re.DOTALL)
    for number, figure in enumerate(map(json.loads, figures), start=1):
        lying = [trace.get("yaxis", "y") for trace in figure["data"] if trace.get("orientation") == "h"]
        names = {f"yaxis{axis[1:]}" for axis in lying}
        for name, axis in figure["layout"].items():
            if re.fullmatch(r"[xy]axis\d*", name) and name not in names and axis.get("showticklabels", True):
                yield f"figure {number}, {name}", axis


@pytest.mark.parametrize("kind", PAGES)
def test_every_axis_has_a_title_with_its_unit(kind: str) -> None:
    named = {place: axis.get("title", {}).get("text", "") for place, axis in axes_of(PAGES[kind]())}
    assert named
    assert {place: title for place, title in named.items() if " in " not in title and title not in PURE} == {}


def luminance(colour: str) -> float:
    """WCAG's relative luminance of `#rrggbb`."""
    shares = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shares]
    return sum(weight * one for weight, one in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


@pytest.mark.parametrize("colour", [*STAGE_COLOURS.values(), *QUANTITY_COLOURS, MUTED, FLOOR])
def test_every_colour_of_a_line_shows_on_both_papers(colour: str) -> None:
    papers = re.findall(r"--paper: (#\w{6})", (TEMPLATES / "style.css").read_text(encoding="utf-8"))
    assert len(papers) == 2
    for paper in papers:
        low, high = sorted((luminance(colour), luminance(paper)))
        assert (high + 0.05) / (low + 0.05) >= 3
