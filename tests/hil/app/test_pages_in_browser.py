"""Pages of reports, campaigns and papers in a real browser, wide and narrow, light and dark: no console error, no
request to a network, no sideways scrolling, no clipped or overlapping text.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hil.app.campaign.page import page_html as campaign_html
from hil.app.papers.page import write_page
from hil.app.report import report_html
from tests.hil.findings import pull_finding, spectrum_finding, table_finding

sync = pytest.importorskip("playwright.sync_api", reason="needs playwright (extra `browser`)")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(
    CHROMIUM is None or "CAPSULE_BROWSER" not in os.environ,
    reason="needs Debian's chromium and CAPSULE_BROWSER=1: minutes on a busy machine",
)

OPENS_S = 2.0
"""A page opens in this time on an idle machine; a busy one may take five times as long."""
KINDS = ("report", "unknown", "table", "spectrum", "campaign", "seeds")
SCROLL = """async () => {
  document.querySelectorAll("details").forEach(one => { one.open = true; });
  const wait = ms => new Promise(r => setTimeout(r, ms));
  for (let y = 0; y < document.body.scrollHeight; y += 600) { scrollTo(0, y); await wait(60); }
  for (let k = 0; k < 50 && document.querySelector(".plot:not(.js-plotly-plot)"); k++)
    await wait(100);
  scrollTo(0, 0);
}"""
FAULTS = """() => {
  const found = [];
  if (!document.documentElement.dataset.ready) found.push("figures are not ready");
  if (document.documentElement.scrollWidth > innerWidth) found.push("scrolls sideways");
  document.querySelectorAll(".plot").forEach(plot => {
    const area = plot.getBoundingClientRect();
    if (!plot.querySelector(".main-svg")) found.push(`${plot.id} is not drawn`);
    plot.querySelectorAll("text").forEach(text => {
      const box = text.getBoundingClientRect();
      if (box.width && (box.left < area.left - 2 || box.right > area.right + 2 || box.bottom > area.bottom + 2))
        found.push(`${plot.id}: clipped ${text.textContent}`);
    });
    plot.querySelectorAll(".subplot").forEach(panel => {
      const ticks = [...panel.querySelectorAll(".xtick text")].map(one => one.getBoundingClientRect());
      ticks.forEach((one, k) => ticks.slice(k + 1).forEach(other => {
        if (Math.min(one.right, other.right) - Math.max(one.left, other.left) > 2
            && Math.min(one.bottom, other.bottom) - Math.max(one.top, other.top) > 2)
          found.push(`${plot.id}: labels overlap`);
      }));
    });
  });
  document.querySelectorAll("h1, h2, h3, p, li, summary, table, .card").forEach(part => {
    const box = part.getBoundingClientRect(), home = part.closest("section, header");
    const room = home ? home.getBoundingClientRect() : { right: innerWidth };
    if (box.right > room.right + 1 && !part.closest(".scroll"))
      found.push(`beyond its card: ${part.textContent.slice(0, 40)}`);
  });
  return [...new Set(found)];
}"""


def campaign_page() -> str:
    point = {"tissue.friction_coefficient": 0.06, "control.controller": "pid", "case": 0}
    rows: list[dict[str, Any]] = [
        {
            "run": k,
            "point": {**point, "case": k, "tissue.friction_coefficient": 0.06 + 0.001 * k, "control.controller": name},
            "result": {"tracking_rmse_m": 1e-4 * (1 + k % 7), "hard_violations": 0, "faults": []},
        }
        for k in range(40)
        for name in ("pid", "mpc")
    ]
    return campaign_html(
        "friction", "tracking_rmse_m", rows, ["tissue.friction_coefficient"], "capsule campaign c.toml"
    )


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    made = {
        "report": report_html(pull_finding(seconds=10.0)),
        "unknown": report_html(pull_finding("unknown", 10.0)),
        "table": report_html(table_finding()),
        "spectrum": report_html(spectrum_finding()),
        "campaign": campaign_page(),
    }
    paths = {name: folder / f"{name}.html" for name in made}
    for name, text in made.items():
        paths[name].write_text(text, encoding="utf-8")
    paths["seeds"] = write_page(folder / "seeds")
    return paths


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with sync.sync_playwright() as player:
        opened = player.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1400, 420])
@pytest.mark.parametrize("kind", KINDS)
def test_page_in_a_browser(browser: Any, pages: dict[str, Path], kind: str, width: int, scheme: str) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on(
        "request",
        lambda asked: said.append(asked.url) if not asked.url.startswith(("file:", "data:", "blob:")) else None,
    )
    try:
        page.goto(pages[kind].as_uri())
        page.wait_for_selector("html[data-ready=yes]", timeout=10_000)
        opened = page.evaluate("performance.now() / 1000")
        page.evaluate(SCROLL)
        assert not said
        assert not page.evaluate(FAULTS)
        assert opened < 5 * OPENS_S, f"opened after {opened:.1f} s"
        ink, paper = page.evaluate(
            "['color', 'backgroundColor'].map(k => getComputedStyle(document.body)[k].match(/\\d+/g).map(Number)[0])"
        )
        assert (ink > paper) == (scheme == "dark")
    finally:
        page.close()


def test_print_holds_whole_figures(browser: Any, pages: dict[str, Path]) -> None:
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.goto(pages["report"].as_uri())
    page.wait_for_selector("html[data-ready=yes]")
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    time.sleep(0.5)
    widths = page.evaluate(
        "[...document.querySelectorAll('.plot .main-svg')].map(one => one.getBoundingClientRect().width)"
    )
    assert widths
    assert max(widths) <= 661
    assert not page.evaluate("document.querySelectorAll('details:not([open])').length")
    page.close()
