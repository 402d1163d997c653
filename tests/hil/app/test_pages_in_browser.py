"""Every kind of page in a real browser, wide and narrow, light and dark: no console error, no request to a network, no
sideways scrolling, no clipped or overlapping text.
"""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.supervision.acceptance import Acceptance
from hil.app.campaign.page import Runs
from hil.app.campaign.page import page_html as campaign_html
from hil.app.campaign.series_answers import answer_of
from hil.app.campaign.series_page import page_html as folders_html
from hil.app.demo.example import ExampleResult, Mission
from hil.app.demo.loop import LOOPS
from hil.app.demo.page import demo_html
from hil.app.papers.seeds import write_page
from hil.app.sil.learning_page import PAGE
from hil.report.closed_loop import report_html
from tests.bench.vibro_sweep import vibro_sweep
from tests.conftest import RIG
from tests.hil.app.campaign.test_campaign_folders import answer
from tests.hil.app.design.test_design import VIBRO
from tests.hil.app.sil.test_learning_page import learned_pages
from tests.hil.findings import pull_finding, spectrum_finding, table_finding
from tests.places import ROOT, SCENARIOS

sync = pytest.importorskip("playwright.sync_api", reason="needs playwright (extra `browser`)")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(
    CHROMIUM is None or "CAPSULE_BROWSER" not in os.environ,
    reason="needs Debian's chromium and CAPSULE_BROWSER=1: minutes on a busy machine",
)

OPENS_S = 2.0
"""Of the browser's main thread at work, waiting for a busy machine left out, until a page can be read."""
CAPSULE = [sys.executable, "-m", "hil.app.start"]
OWN = ROOT / "examples" / "own_record"
SCROLL = """async () => {
  document.querySelectorAll("details").forEach(one => { one.open = true; });
  const wait = ms => new Promise(r => setTimeout(r, ms));
  const frame = () => new Promise(requestAnimationFrame);
  for (let y = 0; y < document.body.scrollHeight; y += 600) {
    scrollTo({ top: y, behavior: "instant" });
    for (let k = 0; k < 3; k++) await frame();
  }
  for (let k = 0; k < 50 && document.querySelector(".plot:not(.js-plotly-plot)"); k++)
    await wait(100);
  scrollTo({ top: 0, behavior: "instant" });
}"""
"""Through the whole page, each place shown for some frames, however slow these come."""
FAULTS = """() => {
  const found = [];
  if (document.scripts.length && !document.documentElement.dataset.ready) found.push("figures are not ready");
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
    point = {"scenario.duration_s": 2.0, "tissue.friction_coefficient": 0.06, "case": 0}
    rows: list[dict[str, Any]] = [
        {
            "run": k,
            "point": {
                **point,
                "case": k,
                "tissue.friction_coefficient": 0.06 + 0.001 * k,
                "control.controller": name,
                "hidden": hidden,
            },
            "result": {"tracking_rmse_m": 1e-4 * (1 + k % 7), "hard_violations": 0, "faults": []},
        }
        for k in range(40)
        for name in ("pid_friction_estimated", "mpc")
        for hidden in ("folds and stenosis", "none")
    ]
    runs = Runs(rows, "tracking_rmse_m", ["tissue.friction_coefficient"])
    return campaign_html("friction", runs, "capsule campaign c.toml")


def text(make: Callable[[], str]) -> Callable[[Path], Path]:
    """A maker of a page from one of its text."""

    def written(folder: Path) -> Path:
        path = folder / "page.html"
        path.write_text(make(), encoding="utf-8")
        return path

    return written


def command(name: str, *words: str) -> Callable[[Path], Path]:
    """A maker of a page as the command line makes it; OUT stands for where it goes."""

    def ran(folder: Path) -> Path:
        out = folder / "page.html" if name == "plot" else folder
        run = [*CAPSULE, *(word.replace("OUT", str(out)) for word in words)]
        subprocess.run(run, check=True, capture_output=True, timeout=300)
        return next(path for path in (folder / "page.html", folder / f"{name}.html") if path.exists())

    return ran


def rig(text: str, *words: str) -> Callable[[Path], Path]:
    """A maker of the design page of a rig file."""

    def ran(folder: Path) -> Path:
        (folder / "rig.toml").write_text(text, encoding="utf-8")
        return command("design", "design", str(folder / "rig.toml"), "--out", "OUT", *words)(folder)

    return ran


def demo_page() -> str:
    finding = pull_finding(seconds=10.0)
    numbers = {"tracking_rmse_m": 1e-3, "tracking_max_m": 2e-3, "stopped_because": "", "log": "mission.blf"}
    t = np.linspace(0.0, 20.0, 400)
    missions = {
        stage: Mission(numbers, t, 1e-3 * (t + lag * np.sin(t)), 1e-3 * t)
        for stage, lag in (("nominal", 2.0), ("calibrated", 1.0), ("augmented", 0.1))
    }
    truth = {"fold_periodic": {"depth": 0.3, "period_m": 4e-3}}
    gate = {stage: Acceptance() for stage in ("calibrated", "augmented")}
    driven = ExampleResult(finding, gate, missions, truth=truth)
    return demo_html([(LOOPS[0], driven), (LOOPS[0], ExampleResult(finding))], 200.0)


def sweep_page(folder: Path) -> Path:
    vibro_sweep(folder)
    return folder / "vibro_sweep.html"


def learning_page(folder: Path) -> Path:
    path = folder / PAGE
    path.write_text(learned_pages(folder)[1][PAGE], encoding="utf-8")
    return path


TRACK = str(SCENARIOS / "track_magnetic_ramp_2.toml")
MAKERS: dict[str, Callable[[Path], Path]] = {
    "report": text(lambda: report_html(pull_finding(seconds=10.0))),
    "unknown": text(lambda: report_html(pull_finding("unknown", 10.0))),
    "table": text(lambda: report_html(table_finding())),
    "spectrum": text(lambda: report_html(spectrum_finding())),
    "campaign": text(campaign_page),
    "learning": learning_page,
    "folders": text(
        lambda: folders_html(
            [answer(f"rig_{k:02}", {"viscous_drag": 0.02} if k % 3 else {}, friction=1 + k / 50) for k in range(12)]
            + [answer_of("broken", {"error": "ValueError: t_s must increase"}, "")]
        )
    ),
    "seeds": lambda folder: write_page(folder),
    "demo": text(demo_page),
    "track": command("track", "track", TRACK, "--controller", "mpc", "--out", "OUT"),
    "compare": command("track", "track", TRACK, "--compare", "--out", "OUT"),
    "plot": command("plot", "plot", str(OWN / "pull_1.csv"), "--rig", str(OWN / "rig.toml"), "--out", "OUT"),
    "design": rig(RIG),
    "design_vibro": rig(VIBRO),
    "sweep": sweep_page,
}


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
