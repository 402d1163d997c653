"""The server of the page: its files, and a socket that sends each page what is new, at most 25 times a second."""

from __future__ import annotations

import contextlib
import hmac
import ipaddress
import json
import secrets
import socket
from collections.abc import Awaitable, Callable
from itertools import islice
from pathlib import Path
from typing import Any, Final

import tornado.httpserver
import tornado.ioloop
import tornado.web
import tornado.websocket

from hil.app.cockpit.operator_panel import OperatorPanel
from hil.app.cockpit.phrases import TEXT
from hil.app.cockpit.source import BIN_S, KEPT_S, BusSource, LogSource
from hil.nodes.operator_sender import CYCLE_S
from hil.report.builder import TEMPLATES

Source = BusSource | LogSource
_HERE: Final = Path(__file__).parent
_FILES: Final = ("cockpit.css", "draw.js", "cockpit.js", "steer.js")
_TYPES: Final = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}
LOOPBACK: Final = ("127.0.0.1", "localhost", "::1")
STATE_EVERY: Final = 5  # Pictures from one state of the cards to the next
OPERATORS: Final = 16  # most pages with the token at a time
WATCHERS: Final = 16  # most pages without it
QUIET_S: Final = 10.0  # How long a connection may take to send a request
_LONGEST: Final = 4096  # bytes of a message from a page
_HEADERS: Final = {  # nothing from elsewhere, nothing kept
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none';"
    " form-action 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


class Cockpit:
    """Pages of one source. `picture` is called every `BIN_S` while a bus is watched."""

    def __init__(self, source: Source, token: str | None = None, operator: OperatorPanel | None = None) -> None:
        """A page needs the `token` to command (random where None); `operator` executes the commands."""
        self.source, self.operator = source, operator
        self.token = secrets.token_urlsafe(18) if token is None else token
        self.pages: dict[Page, None] = {}
        self.pictures = 0

    def application(self, loopback: bool, host: str = "") -> tornado.web.Application:
        """With `loopback` only this machine's own names are answered, else also addresses and `host`."""
        shared = {"cockpit": self, "loopback": loopback, "host": host}
        named = {"/": "page.html", "/style.css": str(TEMPLATES / "style.css"), **{f"/{name}": name for name in _FILES}}
        files = [(path, File, {**shared, "name": name}) for path, name in named.items()]
        return tornado.web.Application(
            [*files, ("/socket", Page, shared)],
            websocket_max_message_size=_LONGEST,
            websocket_ping_interval=5,
            log_function=lambda handler: None,
        )

    def picture(self) -> None:
        assert isinstance(self.source, BusSource)
        self.source.poll()
        self.pictures += 1
        state = self.state() if self.pictures % STATE_EVERY == 0 else None
        for page in tuple(self.pages):
            page.send_new(state)

    def admit(self, page: Page) -> bool:
        """Accept a page where there is room; a page with the token replaces the oldest one, preferably not armed."""
        alike = [other for other in self.pages if other.known == page.known]
        if len(alike) >= (OPERATORS if page.known else WATCHERS):
            if not page.known:
                return False
            operator = self.operator
            oldest = next((other for other in alike if operator is None or not operator.armed(other)), alike[0])
            self.leave(oldest)
            oldest.close(1013, TEXT("page.replaced"))
        self.pages[page] = None
        return True

    def leave(self, page: Page) -> None:
        self.pages.pop(page, None)
        if self.operator is not None:
            self.operator.left(page)

    def state(self) -> dict[str, Any]:
        assert isinstance(self.source, BusSource)
        return {"kind": "state", **self.source.document()}

    def hello(self, commands: bool) -> dict[str, Any]:
        live = isinstance(self.source, BusSource)
        span = {} if isinstance(self.source, BusSource) else {"end_s": self.source.end_s}
        facts = self.source.facts.document()
        return {"kind": "hello", "live": live, "kept_s": KEPT_S, "bin_s": BIN_S, "commands": commands, **span, **facts}


class _Handler(tornado.web.RequestHandler):
    def initialize(self, cockpit: Cockpit, loopback: bool, host: str, name: str = "") -> None:
        self.cockpit, self.loopback, self.host, self.file = cockpit, loopback, host, _HERE / name

    def prepare(self) -> Awaitable[None] | None:
        """Refuse pages of other sites whose own name resolves to this machine."""
        name = self.request.host_name.strip("[]")
        if name not in LOOPBACK and (self.loopback or not (name == self.host or _is_address(name))):
            raise tornado.web.HTTPError(403)
        return None


class File(_Handler):
    def set_default_headers(self) -> None:
        for name, value in _HEADERS.items():
            self.set_header(name, value)

    def get(self) -> None:
        self.set_header("Content-Type", f"{_TYPES[self.file.suffix]}; charset=utf-8")
        self.finish(self.file.read_bytes())


class Page(_Handler, tornado.websocket.WebSocketHandler):
    """One open page; bins that it does not accept in time wait in the ring for the next picture."""

    known = commands = False

    def open(self, *_: str, **__: str) -> None:
        self.next_bin, self.next_event, self._busy = 0, 0, False
        token = self.request.query_arguments.get("token", [b""])[-1]
        self.known = hmac.compare_digest(token, self.cockpit.token.encode())
        if not self.cockpit.admit(self):
            self.close(1013, TEXT("page.full", most=WATCHERS))
            return
        self.commands = self.known and self.cockpit.operator is not None
        self._say(self.cockpit.hello(self.commands))
        if isinstance(self.cockpit.source, BusSource):
            self.send_new(self.cockpit.state())

    def on_message(self, message: str | bytes) -> None:
        """Do what the page asks for; malformed messages and pages without a place get no answer."""
        if self not in self.cockpit.pages:
            return
        try:
            asked = json.loads(message)
            kind = asked["ask"]
            if kind == "window" and isinstance(self.cockpit.source, LogSource):
                times = (float(asked["begin_s"]), float(asked["end_s"]))
                self._answer(self.cockpit.source, *times, int(asked["pixels"]))
            elif self.commands and self.cockpit.operator is not None:
                refused = self.cockpit.operator.asked(self, asked)
                if refused:
                    self._say({"kind": "refused", "words": refused})
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
            return

    def on_close(self) -> None:
        self.cockpit.leave(self)

    def send_new(self, state: dict[str, Any] | None) -> None:
        source = self.cockpit.source
        assert isinstance(source, BusSource)
        if self._busy:
            return
        if state is not None:
            operator = self.cockpit.operator
            more = {"operator": operator.document(self)} if self.commands and operator is not None else {}
            self._say({**state, **more, "events": self._new_events()})
        if source.ring.head > self.next_bin:
            self._write(source.ring.since(self.next_bin))
            self.next_bin = source.ring.head

    def _answer(self, source: LogSource, begin_s: float, end_s: float, pixels: int) -> None:
        if not 0 < end_s - begin_s < float("inf"):
            return
        self._write(source.samples.window(begin_s, end_s, pixels))
        self._say({"kind": "state", **source.document(min(end_s, source.end_s)), "events": self._new_events()})

    def _new_events(self) -> list[list[Any]]:
        watch = self.cockpit.source.watch
        new = min(watch.events_count - self.next_event, len(watch.events))
        self.next_event = watch.events_count
        return [one.document() for one in islice(watch.events, len(watch.events) - new, None)]

    def _say(self, document: dict[str, Any]) -> None:
        self._write(json.dumps(document, allow_nan=False))

    def _write(self, message: str | bytes) -> None:
        try:
            sent = self.write_message(message, binary=isinstance(message, bytes))
        except tornado.websocket.WebSocketClosedError:
            return
        self._busy = True

        async def wait() -> None:
            try:
                await sent
            except tornado.websocket.WebSocketClosedError:
                return
            self._busy = False

        tornado.ioloop.IOLoop.current().add_callback(wait)


def _is_address(name: str) -> bool:
    """Whether a host is given as an address, as a name may belong to another site."""
    with contextlib.suppress(ValueError):
        ipaddress.ip_address(name)
        return True
    return False


def bind(host: str, port: int) -> socket.socket:
    try:
        listener = socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
        listener.setblocking(False)
        return listener
    except OSError as error:
        remedy = "; --port 0 takes a free one" if port else ""
        words = error.strerror or str(error)
        raise ValueError(f"--host and --port must be free to listen on; got {host} {port}: {words}{remedy}") from None


def serve(cockpit: Cockpit, listener: socket.socket, host: str, until: Callable[[], bool]) -> None:
    loop = tornado.ioloop.IOLoop.current()
    server = tornado.httpserver.HTTPServer(
        cockpit.application(host in LOOPBACK, host),
        max_body_size=_LONGEST,
        max_header_size=4 * _LONGEST,
        idle_connection_timeout=QUIET_S,
        body_timeout=QUIET_S,
    )
    server.add_socket(listener)

    def look() -> None:
        if until():
            loop.stop()

    calls = [tornado.ioloop.PeriodicCallback(look, 100)]
    if isinstance(cockpit.source, BusSource):
        calls.append(tornado.ioloop.PeriodicCallback(cockpit.picture, 1e3 * BIN_S))
    if cockpit.operator is not None:
        calls.append(tornado.ioloop.PeriodicCallback(cockpit.operator.cycle, 1e3 * CYCLE_S))
    for call in calls:
        call.start()
    try:
        loop.start()
    finally:
        for call in calls:
            call.stop()
        server.stop()
        for page in tuple(cockpit.pages):
            page.close(1001, TEXT("page.over"))
