"""The page in a real browser: it attaches, shows a capsule move and an alarm, stops it, loses the connection and gets
it back; wide and narrow, light and dark, nothing clipped, no request to a network.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.hil.app.cockpit.chromium import LONG_MS, NEEDS_BROWSER, waited
from tests.hil.app.cockpit.puppet import puppet_on
from tests.hil.app.cockpit.story import story
from tests.hil.app.run.deployments import deployment, rig_file
from tests.hil.log.test_log_record import blf
from tests.places import ROOT

pytestmark = NEEDS_BROWSER
FAULTS = r"""() => {
  const found = [];
  if (document.documentElement.scrollWidth > innerWidth) found.push("scrolls sideways");
  document.querySelectorAll("h1, h2, p, td, th, button, label, .fact b, .legend span, #events li").forEach(part => {
    const box = part.getBoundingClientRect(), home = part.closest("section, .panel, .fact, #bar");
    const room = home ? home.getBoundingClientRect() : { left: 0, right: innerWidth };
    if (box.width && (box.right > room.right + 1 || box.left < room.left - 4))
      found.push(`beyond: ${part.textContent.slice(0, 40)}`);
    if (part.scrollWidth > part.clientWidth + 1 && getComputedStyle(part).overflow === "hidden")
      found.push(`clipped: ${part.textContent.slice(0, 40)}`);
  });
  const texts = document.createTreeWalker(document.querySelector("main"), NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const text = texts.currentNode, home = text.parentElement;
    if (/\d/.test(text.textContent) && home.offsetParent && !home.closest("#who") && !home.closest("[title]")?.title)
      found.push(`a number without a tooltip: ${text.textContent.slice(0, 40)}`);
  }
  document.querySelectorAll("canvas").forEach(one => { if (!one.width) found.push("a panel is not drawn"); });
  return [...new Set(found)];
}"""
DRAWN = "document.querySelectorAll('.fact b').length === 6 && Number(document.documentElement.dataset.drawn || 0) > 0"


@contextmanager
def cockpit_on(source: str, port: int = 0) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """`capsule cockpit` on a source, and its address with the token."""
    command = [sys.executable, "-m", "hil.app.start", "cockpit", source, "--port", str(port), "--json"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    try:
        assert child.stdout is not None
        text = ""
        while not text.endswith("}\n"):
            text += child.stdout.readline()
        yield child, json.loads(text)["address"]
    finally:
        child.terminate()
        child.communicate(timeout=30)


Open = Callable[..., Any]


@pytest.fixture
def opened(browser: Any) -> Iterator[Open]:
    """Opens a page, which must not complain or ask anybody else."""
    said: list[str] = []
    pages: list[Any] = []

    def open_page(address: str, width: int = 1400, scheme: str = "light") -> Any:
        page = browser.new_page(viewport={"width": width, "height": 3000}, color_scheme=scheme)
        pages.append(page)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda asked: said.append(asked.url) if "//127.0.0.1:" not in asked.url else None)
        page.goto(address)
        shows(page, DRAWN)
        assert "token" not in page.url
        return page

    yield open_page
    for page in pages:
        page.close()
    assert [words for words in said if not words.startswith("data:")] == []


def shows(page: Any, expression: str) -> None:
    """Wait until it is so in the page, whose policy lets no script be made of a text."""
    waited(page, lambda: page.evaluate(expression))


def link(page: Any, words: str) -> None:
    shows(page, f"document.documentElement.dataset.link === {words!r}")


def event(page: Any, words: str) -> None:
    shows(page, f"document.querySelector('#events').textContent.includes({words!r})")


@pytest.fixture
def rig(tmp_path: Path, channel: str) -> str:
    return rig_file(tmp_path, deployment(channel, more="[operator]\naccept = true\n"))


def test_a_bus_is_watched_steered_and_stopped(opened: Open, rig: str, channel: str) -> None:
    with cockpit_on(rig) as (_, address), puppet_on(channel) as puppet:
        page = opened(address)
        link(page, "live")
        position = "parseFloat(document.querySelector('.fact b').textContent.replace('−', '-'))"
        first = page.evaluate(position)
        shows(page, f"{position} > {first} + 2")
        event(page, "broken (sudden change)")
        assert page.inner_text("#refused") == ""

        page.check("#arm")
        page.wait_for_selector("#forth:visible", timeout=LONG_MS)
        box = page.locator("#forth").bounding_box()
        page.mouse.move(box["x"] + 20, box["y"] + 10)
        page.mouse.down()
        waited(page, lambda: puppet.held > 5)
        assert puppet.speed_m_s == pytest.approx(2.5e-3, abs=1e-4)
        page.mouse.move(5, 5)
        waited(page, lambda: puppet.released > 5)
        page.mouse.up()

        page.mouse.move(box["x"] + 20, box["y"] + 10)
        page.mouse.down()
        waited(page, lambda: puppet.held > 5)
        page.evaluate("dispatchEvent(new Event('blur'))")
        waited(page, lambda: puppet.released > 5)
        page.mouse.up()

        page.click("#safe")
        event(page, "carriage: enabled → standby")
        assert puppet.stopped


def test_the_connection_is_lost_and_comes_back(opened: Open, rig: str, channel: str) -> None:
    with puppet_on(channel) as puppet:
        with cockpit_on(rig) as (_, address):
            page = opened(address.split("#")[0])
            link(page, "live")
            assert page.is_hidden("#operator")
            puppet.mute.set()
            link(page, "no frames")
            event(page, "controller is silent: sends nothing any more")
            puppet.mute.clear()
            link(page, "live")
            event(page, "controller is heard again")
        link(page, "connection lost")
        assert page.is_visible("#trouble")
        port = int(address.split(":")[2].split("/")[0])
        with cockpit_on(rig, port):
            link(page, "live")
            assert page.is_hidden("#trouble")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1400, 420])
def test_the_page_is_whole_in_every_window(opened: Open, rig: str, channel: str, width: int, scheme: str) -> None:
    with cockpit_on(rig) as (_, address), puppet_on(channel):
        page = opened(address, width, scheme)
        page.check("#arm")
        event(page, "broken (sudden change)")
        page.wait_for_selector("#forth:visible", timeout=LONG_MS)
        assert page.evaluate(FAULTS) == []
        keep(page, f"live_{width}_{scheme}")
        ink, paper = page.evaluate(
            "['color', 'backgroundColor'].map(k => getComputedStyle(document.body)[k].match(/\\d+/g).map(Number)[0])"
        )
        assert (ink > paper) == (scheme == "dark")


@pytest.mark.parametrize(("width", "scheme"), [(1400, "dark"), (420, "light")])
def test_a_log_is_scrubbed(opened: Open, tmp_path: Path, width: int, scheme: str) -> None:
    with cockpit_on(str(blf(tmp_path / "run.blf", story(12.0)))) as (_, address):
        page = opened(address, width, scheme)
        model = "document.querySelectorAll('.fact b')[3].textContent"
        shows(page, f"{model} === 'broken'")
        assert page.evaluate(FAULTS) == []
        keep(page, f"log_{width}_{scheme}")
        page.click("#spans button:first-child")
        page.evaluate("const s = document.querySelector('#scrub'); s.value = 1.5; s.dispatchEvent(new Event('input'))")
        shows(page, f"{model} === 'holds'")
        page.click("#play")
        shows(page, f"{model} === 'broken'")


def keep(page: Any, name: str) -> None:
    """A picture to look at, where CAPSULE_PICTURES names a folder."""
    if folder := os.environ.get("CAPSULE_PICTURES"):
        page.wait_for_timeout(1000)
        page.screenshot(path=Path(folder) / f"{name}.png", full_page=True)
