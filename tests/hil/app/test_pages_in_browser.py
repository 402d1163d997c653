"""Every kind of page in a real browser, wide, narrow and printed, light and dark: no console error, no request to a
network, no sideways scrolling, no clipped, cut or overlapping text, no axis without a title, contrast of WCAG AA.
"""

import os
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.hil.app.page_faults import CONTRAST, CUT, FAULTS, SCROLL
from tests.hil.app.page_makers import MAKERS

sync = pytest.importorskip("playwright.sync_api", reason="needs playwright (extra `browser`)")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(
    CHROMIUM is None or "CAPSULE_BROWSER" not in os.environ,
    reason="needs Debian's chromium and CAPSULE_BROWSER=1: minutes on a busy machine",
)

OPENS_S = 2.0
"""Of the browser's main thread at work, waiting for a busy machine left out, until a page can be read."""


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """A page of each kind, made when first asked for."""
    made: dict[str, Path] = {}

    def page(kind: str) -> Path:
        if kind not in made:
            made[kind] = MAKERS[kind](tmp_path_factory.mktemp(kind))
        return made[kind]

    return page


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with sync.sync_playwright() as player:
        opened = player.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1400, 420])
@pytest.mark.parametrize("kind", MAKERS)
def test_page_in_a_browser(browser: Any, pages: Callable[[str], Path], kind: str, width: int, scheme: str) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on(
        "request",
        lambda asked: said.append(asked.url) if not asked.url.startswith(("file:", "data:", "blob:")) else None,
    )
    try:
        meter = page.context.new_cdp_session(page)
        meter.send("Performance.enable", {"timeDomain": "threadTicks"})
        page.goto(pages(kind).as_uri())
        page.wait_for_selector("html[data-ready=yes], html:not(:has(script))", timeout=30_000)
        metrics = meter.send("Performance.getMetrics")["metrics"]
        opened = next(row["value"] for row in metrics if row["name"] == "TaskDuration")
        page.evaluate(SCROLL)
        assert not said
        assert not page.evaluate(FAULTS)
        assert not page.evaluate(CONTRAST)
        assert not page.evaluate(CUT)
        assert 0 < opened < OPENS_S, f"opened after {opened:.1f} s"
        ink, paper = page.evaluate(
            "['color', 'backgroundColor'].map(k => getComputedStyle(document.body)[k].match(/\\d+/g).map(Number)[0])"
        )
        assert (ink > paper) == (scheme == "dark")
    finally:
        page.close()


DRAWN = "[...document.querySelectorAll('.plot')].map(one => Boolean(one.querySelector('.main-svg')))"


def test_figures_are_drawn_when_scrolled_to(browser: Any, pages: Callable[[str], Path]) -> None:
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.goto(pages("seeds").as_uri())
    page.wait_for_selector("html[data-ready=yes]")
    first, *_, last = page.evaluate(DRAWN)
    assert first
    assert not last
    page.evaluate("[...document.querySelectorAll('.plot')].at(-1).scrollIntoView({ behavior: 'instant' })")
    page.wait_for_function(f"{DRAWN}.at(-1)")
    page.close()


A4 = {"width": 688, "height": 1000}
"""Pixels of a printed page within its margins."""


@pytest.mark.parametrize("kind", MAKERS)
def test_printed_tables_are_whole_and_headings_stay_with_what_they_head(
    browser: Any, pages: Callable[[str], Path], kind: str
) -> None:
    page = browser.new_page(viewport=A4)
    page.goto(pages(kind).as_uri())
    page.wait_for_selector("html[data-ready=yes], html:not(:has(script))", timeout=30_000)
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert not page.evaluate(CUT)
    wide = "[...document.querySelectorAll('table')].filter(one => one.getBoundingClientRect().right > innerWidth + 1)"
    assert not page.evaluate(f"{wide}.map(one => one.textContent.slice(0, 40))")
    apart = "[...document.querySelectorAll('h2, h3')].filter(one => getComputedStyle(one).breakAfter !== 'avoid')"
    assert not page.evaluate(f"{apart}.length")
    assert not page.evaluate(
        "[...document.querySelectorAll('.save')].filter(one => one.getClientRects().length).length"
    )
    page.close()


def test_a_figure_is_saved_as_picture_and_as_table(browser: Any, pages: Callable[[str], Path]) -> None:
    page = browser.new_page(viewport={"width": 1400, "height": 900}, color_scheme="dark")
    page.goto(pages("report").as_uri())
    page.wait_for_selector("#error .save")
    saved = {}
    for kind in ("SVG", "PNG", "CSV"):
        with page.expect_download() as waiting:
            page.click(f"#error .save button:text('{kind}')")
        saved[kind] = waiting.value
    assert saved["SVG"].suggested_filename == "figure_1_error_before_and_after.svg"
    drawn = Path(saved["SVG"].path()).read_text(encoding="utf-8")
    assert "error of the force in mN" in drawn
    assert "fill: rgb(255, 255, 255)" in drawn
    assert Path(saved["PNG"].path()).read_bytes()[:4] == b"\x89PNG"
    head, *rows = Path(saved["CSV"].path()).read_text(encoding="utf-8").splitlines()
    assert head.startswith("x axis,y axis,series,x,y")
    assert [row.split(",")[:4] for row in rows[:2]] == [
        ["records", "error of the force in mN", "nominal", part] for part in ("training", "held out")
    ]
    page.close()


def test_print_holds_whole_figures(browser: Any, pages: Callable[[str], Path]) -> None:
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.goto(pages("report").as_uri())
    page.wait_for_selector("html[data-ready=yes]")
    assert not all(page.evaluate(DRAWN))
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    time.sleep(0.5)
    assert all(page.evaluate(DRAWN))
    widths = page.evaluate(
        "[...document.querySelectorAll('.plot .main-svg')].map(one => one.getBoundingClientRect().width)"
    )
    assert widths
    assert max(widths) <= 661
    assert not page.evaluate("document.querySelectorAll('details:not([open])').length")
    page.close()
