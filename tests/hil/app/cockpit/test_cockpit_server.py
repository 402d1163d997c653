"""The page's server: what it gives to whom, how little it sends, and sentences for what cannot be."""

import asyncio
import json
import re
import socket
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

web = pytest.importorskip("tornado.web", reason="needs tornado (extra `cockpit`)")

import tornado.httpclient  # noqa: E402
import tornado.httpserver  # noqa: E402
import tornado.websocket  # noqa: E402

from hil.app.cockpit.operator_panel import OperatorPanel  # noqa: E402
from hil.app.cockpit.panels import Facts  # noqa: E402
from hil.app.cockpit.server import OPERATORS, WATCHERS, Cockpit, bind  # noqa: E402
from hil.app.cockpit.source import BusSource, LogSource  # noqa: E402
from hil.app.run.clock import Clock, ClockedBus  # noqa: E402
from hil.bus.local import LocalBus  # noqa: E402
from hil.nodes.frame_map import FRAME_MAPS  # noqa: E402
from hil.nodes.operator import OperatorLimits  # noqa: E402
from tests.hil.app.cockpit.played import played  # noqa: E402
from tests.hil.app.cockpit.story import CATALOGUE, story  # noqa: E402

FACTS = Facts("test", "", FRAME_MAPS["magnetic"], CATALOGUE)
Talk = Callable[[Cockpit, str], Awaitable[Any]]


PAGES: list[Any] = []
"""Those that have come, each closed at the end."""


def served(cockpit: Cockpit, talk: Talk) -> Any:
    """What `talk(cockpit, "127.0.0.1:PORT")` comes to while the cockpit is served."""

    async def go() -> Any:
        listener = bind("127.0.0.1", 0)
        server = tornado.httpserver.HTTPServer(cockpit.application(True))
        server.add_socket(listener)
        try:
            return await asyncio.wait_for(talk(cockpit, f"127.0.0.1:{listener.getsockname()[1]}"), 20)
        finally:
            while PAGES:
                PAGES.pop().close()
            server.stop()
            await server.close_all_connections()
            await asyncio.sleep(0.1)  # both ends of a socket close in the loop's next rounds

    return asyncio.run(go())


@pytest.fixture(scope="module")
def log() -> LogSource:
    return LogSource(story(3.0), FACTS)


async def fetched(address: str, **more: Any) -> Any:
    return await tornado.httpclient.AsyncHTTPClient().fetch(address, raise_error=False, **more)


async def left(page: Any) -> None:
    """The page goes away."""
    page.close()
    while await page.read_message() is not None:
        pass


async def come(address: str) -> tuple[Any, dict[str, Any]]:
    """A page, and what it is told first."""
    page = await tornado.websocket.websocket_connect(address)
    PAGES.append(page)
    return page, json.loads(await page.read_message())


def test_the_page_is_whole_and_asks_nobody_else(log: LogSource) -> None:
    async def talk(_: Cockpit, where: str) -> None:
        page = await fetched(f"http://{where}/")
        assert page.code == 200
        assert page.headers["Content-Security-Policy"].startswith("default-src 'self'")
        linked = re.findall(r'(?:src|href)="(/[^"]+)"', page.body.decode())
        assert len(linked) == 5
        for path in linked:
            found = await fetched(f"http://{where}{path}")
            assert found.code == 200
            for address in re.findall(r"https?://[^\s\"'`)]+", found.body.decode()):
                assert address.startswith("http://www.w3.org/")
        assert (await fetched(f"http://{where}/../command.py")).code in (400, 404)

    served(Cockpit(log), talk)


def test_another_name_for_this_machine_is_not_answered(log: LogSource) -> None:
    async def talk(_: Cockpit, where: str) -> None:
        assert (await fetched(f"http://{where}/", headers={"Host": "evil.example"})).code == 403
        assert (await fetched(f"http://{where}/", headers={"Host": "localhost:80"})).code == 200
        upgrade = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
        other = {**upgrade, "Sec-WebSocket-Key": "x", "Origin": "http://evil.example"}
        assert (await fetched(f"http://{where}/socket", headers=other)).code == 403

    served(Cockpit(log), talk)


def test_a_log_is_asked_for_a_window_at_a_time(log: LogSource) -> None:
    async def talk(cockpit: Cockpit, where: str) -> None:
        page, hello = await come(f"ws://{where}/socket")
        assert (hello["live"], hello["commands"]) == (False, False)
        for nonsense in (
            "",
            "[]",
            "{}",
            '{"ask": "window"}',
            '{"ask": "window", "begin_s": 2, "end_s": 1, "pixels": 9}',
        ):
            await page.write_message(nonsense)
        await page.write_message(json.dumps({"ask": "window", "begin_s": 0.0, "end_s": 3.0, "pixels": 300}))
        spans, state = await page.read_message(), json.loads(await page.read_message())
        assert len(spans) < 24 + 300 * 8 * sum(len(panel["lines"]) for panel in hello["panels"]) + 1
        assert state["model"]["state"] == "broken"
        assert any("broken" in words for _, words, _ in state["events"])
        await left(page)

    served(Cockpit(log), talk)


def test_a_bus_is_watched_and_a_picture_is_small(channel: str) -> None:
    """Each page gets each bin once; nothing is sent on the bus."""

    async def talk(cockpit: Cockpit, where: str) -> None:
        page, hello = await come(f"ws://{where}/socket?token={cockpit.token}")
        assert hello["commands"] is False  # there are no operator
        sizes, states, bins = [], [], 0
        for _ in range(30):
            cockpit.picture()
            await asyncio.sleep(0.04)
        page.write_message("{}")
        while len(sizes) < 20:
            told = await page.read_message()
            if isinstance(told, bytes):
                sizes.append(len(told))
                assert int.from_bytes(told[:4], "little") == bins
                bins += int.from_bytes(told[4:8], "little")
            else:
                states.append(json.loads(told))
        lines = sum(len(panel["lines"]) for panel in hello["panels"])
        assert sorted(sizes[1:])[len(sizes) // 2] <= 24 + 3 * 8 * lines
        assert states[-1]["readings"]["reference"].endswith(" mm")
        await left(page)

    with LocalBus(channel) as quiet, played(story(4.0)[800:], channel):
        clock = Clock()
        bus = ClockedBus(LocalBus(channel), clock)
        served(Cockpit(BusSource(bus, clock, FACTS)), talk)
        bus.shutdown()
        known = {frame.id for frame in story(0.2)}
        assert all(message.arbitration_id in known for message in iter(lambda: quiet.recv(0), None))


def test_only_the_right_token_commands(channel: str) -> None:
    async def talk(cockpit: Cockpit, where: str) -> list[bool]:
        found = []
        for token in ("wrong", "", cockpit.token):
            page, hello = await come(f"ws://{where}/socket?token={token}")
            found.append(hello["commands"])
            await page.write_message(json.dumps({"ask": "arm", "on": True}))
            await page.write_message(json.dumps({"ask": "hold", "mode": "speed", "value": 1e-3}))
            await asyncio.sleep(0.1)
            assert cockpit.operator is not None
            cockpit.operator.cycle()
            await left(page)
        return found

    setpoint = CATALOGUE["OperatorSetpoint"].id
    with LocalBus(channel) as bus, LocalBus(channel) as ear:
        source = BusSource(bus, Clock(), FACTS)
        operator = OperatorPanel(source, Path("x.toml"), OperatorLimits(accept=True))
        assert served(Cockpit(source, operator=operator), talk) == [False, False, True]
        heard = list(iter(lambda: ear.recv(0), None))
        assert [message.arbitration_id for message in heard] == [setpoint]


def test_those_without_the_token_leave_the_operators_places(channel: str) -> None:
    """Watchers fill their own places; an operator gets in, is shown the run and stops it, and the seventeenth takes
    the place of the oldest that is not armed.
    """

    async def talk(cockpit: Cockpit, where: str) -> None:
        watchers = [await come(f"ws://{where}/socket") for _ in range(WATCHERS)]
        refused = await tornado.websocket.websocket_connect(f"ws://{where}/socket?token=wrong")
        PAGES.append(refused)
        assert await refused.read_message() is None
        assert (refused.close_code, refused.close_reason) == (1013, f"at most {WATCHERS} pages without the token")
        operators = [await come(f"ws://{where}/socket?token={cockpit.token}") for _ in range(OPERATORS)]
        assert all(hello["commands"] for _, hello in operators)
        await operators[0][0].write_message(json.dumps({"ask": "arm", "on": True}))
        await operators[-1][0].write_message(json.dumps({"ask": "safe_stop"}))
        await asyncio.sleep(0.1)
        assert cockpit.operator is not None
        cockpit.operator.cycle()
        late, hello = await come(f"ws://{where}/socket?token={cockpit.token}")
        assert hello["commands"]
        gone = operators[1][0]
        while await gone.read_message() is not None:
            pass
        assert gone.close_reason == "a newer page with the token took this place"
        assert len(cockpit.pages) == WATCHERS + OPERATORS
        for page in (late, *(page for page, _ in [*watchers, *operators] if page is not gone)):
            await left(page)

    with LocalBus(channel) as bus, LocalBus(channel) as ear:
        source = BusSource(bus, Clock(), FACTS)
        served(Cockpit(source, operator=OperatorPanel(source, Path("x.toml"), OperatorLimits(accept=True))), talk)
        heard = {message.arbitration_id for message in iter(lambda: ear.recv(0), None)}
        assert CATALOGUE["SafeStop"].id in heard


NONSENSE: tuple[str | bytes, ...] = (
    "[" * 3000,
    '{"a":' * 800,
    '{"ask": ' + "[" * 3000,
    "",
    "null",
    "1",
    '"ask"',
    "[]",
    "{}",
    '{"ask": null}',
    '{"ask": ["start"]}',
    '{"ask": {"start": 1}}',
    '{"ask": "hold"}',
    '{"ask": "hold", "mode": [], "value": {}}',
    '{"ask": "hold", "mode": "speed", "value": NaN}',
    '{"ask": "hold", "mode": "speed", "value": ' + "9" * 4000 + "}",
    '{"ask": "hold", "mode": "speed", "value": "1e-3"}',
    '{"ask": "arm"}',
    '{"ask": "window", "begin_s": -1e308, "end_s": 1e308, "pixels": 9}',
    '{"ask": "window", "begin_s": NaN, "end_s": 1, "pixels": 9}',
    '{"ask": "window", "begin_s": 0, "end_s": 1, "pixels": 1e999}',
    '{"ask": "window", "begin_s": 0, "end_s": 1, "pixels": -1}',
    '{"ask": "window", "begin_s": 0, "end_s": 5e-324, "pixels": 99999999}',
    '{"ask": "window", "begin_s": [0], "end_s": {}, "pixels": null}',
    '{"ask": "\\ud800"}',
    b"\xff\xfe\x00",
    b"\x00" * 4000,
    b"[" * 3000,
)


@pytest.mark.parametrize("live", [True, False])
def test_no_message_and_no_request_is_a_traceback(
    log: LogSource, channel: str, live: bool, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    """Whatever a page sends, it is answered or left unanswered, and the next page is served; one that is too long ends
    the page that sent it.
    """

    async def talk(cockpit: Cockpit, where: str) -> None:
        for token in ("", cockpit.token, "%ff", "%ed%a0%80", "a&token=b", "x" * 3000):
            page, _ = await come(f"ws://{where}/socket?token={token}")
            for message in NONSENSE:
                await page.write_message(message, binary=isinstance(message, bytes))
            await left(page)
        page, _ = await come(f"ws://{where}/socket")
        await page.write_message("x" * 100_000)
        await left(page)
        for path in ("/socket", "/?token=%ff", "/%ff", "/a\\b", "/page.html", "/" + "x" * 3000):
            assert (await fetched(f"http://{where}{path}")).code in (200, 400, 404, 426)
        for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS"):
            for path in ("/", "/socket"):
                body = {} if method in ("DELETE", "OPTIONS") else {"body": "[" * 3000}
                assert (await fetched(f"http://{where}{path}", method=method, **body)).code in (400, 405)
        for raw in (b"\x00" * 100, b"GET / HTTP/1.1\r\nHost: [\r\n\r\n", b"GET / HTTP/1.1\r\n: x\r\n\r\n"):
            reader, writer = await asyncio.open_connection(*where.split(":"))
            writer.write(raw)
            writer.write_eof()
            await reader.read()
            writer.close()
        assert (await fetched(f"http://{where}/")).code == 200

    if live:
        with LocalBus(channel) as bus:
            source = BusSource(bus, Clock(), FACTS)
            served(Cockpit(source, operator=OperatorPanel(source, Path("x.toml"), OperatorLimits(accept=True))), talk)
    else:
        served(Cockpit(log), talk)
    assert [record for record in caplog.records if record.exc_info] == []
    assert "Traceback" not in caplog.text + "".join(capfd.readouterr())


def test_a_cockpit_for_others_answers_addresses_alone(log: LogSource) -> None:
    """Another site's name that leads to this machine is not answered there, either."""

    async def go() -> list[int]:
        listener = bind("127.0.0.1", 0)
        server = tornado.httpserver.HTTPServer(Cockpit(log).application(False, "lab-pc"))
        server.add_socket(listener)
        address = f"http://127.0.0.1:{listener.getsockname()[1]}/"
        try:
            hosts = ("evil.example", "127.0.0.1", "10.1.2.3:80", "[fe80::1]", "lab-pc", "localhost")
            return [(await fetched(address, headers={"Host": host})).code for host in hosts]
        finally:
            while PAGES:
                PAGES.pop().close()
            server.stop()
            await server.close_all_connections()
            await asyncio.sleep(0.1)

    assert asyncio.run(go()) == [403, 200, 200, 200, 200, 200]


def test_a_port_that_is_taken_is_a_sentence() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(ValueError, match=r"must be free to listen on; got 127\.0\.0\.1"):
            bind("127.0.0.1", taken.getsockname()[1])
