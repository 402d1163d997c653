"""Every button in every state of drive and run, pressed on the page in a real browser, wide and narrow: what it does
and says is what the table in the docs states.
"""

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

import pytest

from tests.hil.app.cockpit.chromium import NEEDS_BROWSER, waited
from tests.hil.app.cockpit.stage import DRIVES, RUNS, Pressed, Seen, Stage, acted, settled
from tests.hil.app.docs.buttons import HELD, shown, table
from tests.places import ROOT

tornado = pytest.importorskip("tornado", reason="needs tornado (extra `cockpit`)")
from tornado.httpserver import HTTPServer  # noqa: E402

from hil.app.cockpit.operator_panel import OperatorPanel  # noqa: E402
from hil.app.cockpit.server import Cockpit, bind  # noqa: E402

pytestmark = NEEDS_BROWSER
SHOWN: Final = """() => {
  const seen = {};
  for (const name of ["start", "reset", "stop", "safe", "arm", "back", "forth", "go"]) {
    const one = document.getElementById(name), box = one.getBoundingClientRect();
    if (box.width && box.right <= innerWidth && box.left >= 0 && box.bottom <= innerHeight)
      seen[name] = [!one.disabled, (name === "arm" ? one.closest("label") : one).title, box.x + 5, box.y + 5];
  }
  const text = id => document.getElementById(id).textContent;
  return { seen, words: text("run_words"), steering: text("steering") };
}"""


class Served:
    """A stage and its page; the server's loop runs in a thread, in which alone the stage is touched."""

    def __init__(self, accepts: bool, browser: Any, width: int) -> None:
        self.stage = Stage(accepts)
        self.sent = self.arrived = 0
        self.stage.panel.asked = self._asked  # type: ignore[method-assign]
        self.cockpit = Cockpit(self.stage.source, operator=self.stage.panel)
        self.loop = asyncio.new_event_loop()
        threading.Thread(target=self.loop.run_forever, daemon=True).start()
        listener = bind("127.0.0.1", 0)
        self.server = self.do(lambda: HTTPServer(self.cockpit.application(True)))
        self.do(lambda: self.server.add_socket(listener))
        self.page = browser.new_page(viewport={"width": width, "height": 700 if width > 1000 else 900})
        self.page.goto(f"http://127.0.0.1:{listener.getsockname()[1]}/#token={self.cockpit.token}")
        waited(self.page, lambda: bool(self.page.evaluate("page.hello !== null")))

    def do(self, what: Callable[[], Any]) -> Any:
        async def done() -> Any:
            return what()

        return asyncio.run_coroutine_threadsafe(done(), self.loop).result(30)

    def close(self) -> None:
        self.page.close()
        self.stage.panel._run = None

        def end() -> None:
            self.server.stop()
            self.stage.panel.close()

        self.do(end)
        asyncio.run_coroutine_threadsafe(self.server.close_all_connections(), self.loop).result(30)
        self.loop.call_soon_threadsafe(self.loop.stop)

    def told(self) -> None:
        """The page shows the newest state."""

        def tell() -> float:
            state = self.cockpit.state()
            for one in tuple(self.cockpit.pages):
                one._busy = False
                one.send_new(state)
            return float(state["time_s"])

        time_s = self.do(tell)
        while self.page.evaluate("page.state?.time_s") != time_s:
            pass

    def put(self, run: str, drive: str) -> None:
        self.do(lambda: self.stage.put(RUNS[run], drive))
        self.told()

    def seen(self, run: str, drive: str) -> Seen:
        """All buttons that the page shows in a state, pressed where they count."""
        self.put(run, drive)
        if RUNS[run].accepts:
            self.page.check("#arm")
            self.told()
        now, found = self.page.evaluate(SHOWN), {}
        assert list(now["seen"]) == shown(run, drive)
        for name, (counts, tip, x, y) in now["seen"].items():
            does, then = self.pressed(run, drive, name, x, y) if counts else ("", "")
            found[name] = Pressed(counts, settled(tip), does, then)
        return Seen(found, settled(now["words"]), settled(now["steering"]))

    def pressed(self, run: str, drive: str, name: str, x: float, y: float) -> tuple[str, str]:
        """What a press does and says."""
        self.do(lambda: self.stage.put(RUNS[run], drive))
        if name == "arm":
            self.page.uncheck("#arm")
            self.settle()
            self.do(self.stage.outcome)
        self.do(self.stage.begin)
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        if name not in HELD:
            self.page.mouse.up()
        self.settle()
        does, then = self.do(self.stage.outcome)
        if name in HELD:
            self.page.mouse.up()
            self.settle()
        if then:
            self.told()
            shows = self.page.evaluate("document.querySelector('#events li span').textContent")
            assert settled(shows) == then, "the newest event is on the page"
            self.put(run, drive)
        return does, then

    def settle(self) -> None:
        """What the page has sent has arrived: a message behind it has."""
        self.sent += 1
        self.page.evaluate(f"send({{ ask: 'settle', number: {self.sent} }})")
        while self.arrived < self.sent:
            pass

    def _asked(self, page: object, asked: dict[str, Any]) -> str:
        if asked["ask"] == "settle":
            self.arrived = asked["number"]
            return ""
        return OperatorPanel.asked(self.stage.panel, page, asked)


@contextmanager
def served(accepts: bool, browser: Any, width: int) -> Iterator[Served]:
    one = Served(accepts, browser, width)
    try:
        yield one
    finally:
        one.close()


@pytest.mark.parametrize("width", [1400, 420])
def test_each_button_in_each_state_does_and_says_what_the_table_states(browser: Any, width: int) -> None:
    found: dict[tuple[str, str], Seen] = {}
    for accepts in (True, False):
        with served(accepts, browser, width) as one, acted():
            for run in [name for name in RUNS if RUNS[name].accepts == accepts]:
                for drive in DRIVES:
                    found[run, drive] = one.seen(run, drive)
    lines = table({(run, drive): found[run, drive] for run in RUNS for drive in DRIVES}).splitlines()
    stated = (ROOT / "docs" / "cockpit.md").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if line not in stated] == [], "python -m tests.hil.app.docs.pages writes the tables"
