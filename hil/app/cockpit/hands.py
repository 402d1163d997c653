"""What a page with the token may do: start and stop a run, and steer with a dead-man switch. Nothing is sent before."""

import json
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import IO, Any, Final

from hil.app.cockpit.source import BusSource
from hil.app.cockpit.watch import words
from hil.bus.protection import FrameTransmitter
from hil.nodes.operator import STATUS, OperatorLimits
from hil.nodes.operator_sender import OperatorSender
from hil.own_process import own_environment, own_module

HOLD_S: Final = 0.12
"""How long a page's word that its button is held counts; it says so every 40 ms."""
LIFE_MS: Final = 100.0  # for which a setpoint holds
PARTING_S: Final = 0.2  # for which a release is said
PRESS_S: Final = 0.15  # of a press that stops the drive
SAFE_S: Final = 0.5  # for which a safe stop is said
SAFE_STOP: Final = {"Target": 0.0, "Reason": 0.0}  # of every drive, by an operator
ENDS_S: Final = 10.0  # in which a run ends after an interruption
_OTHER: Final = "another page steers"
_THROUGH: Final = "the button was held through a stop, or while another page steered: let it go first"
_RESTS: Final = ("boot", "self_test", "standby", "fault")
"""States of a drive that moves nothing, and that nothing is about to enable."""


class Hands:
    """Commands on the bus of `source`, deployed by `path`; `limits` None: no setpoints are accepted. `cycle` is called
    every 20 ms: while a page is armed it sends OperatorSetpoint, held only while the page that steers has said so
    within `HOLD_S`. A safe stop is the bus's own SafeStop for all. A controlled stop is Ctrl-C to a run started here;
    to another run it is a short press at speed 0. A button that was held through a stop, or while another page steered,
    counts once it has been let go. Runs are started by a thread that keeps the niceness of now.
    """

    def __init__(
        self,
        source: BusSource,
        path: Path,
        limits: OperatorLimits | None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.source, self.path, self.limits = source, path, limits
        self._clock = clock
        self._sender = OperatorSender(source.bus, "cockpit", LIFE_MS, clock)
        self._stops = FrameTransmitter(source.bus, ("SafeStop",))
        self._armed: set[object] = set()
        self._steers: object | None = None
        self._through: dict[object, float] = {}
        self._held_at, self._wanted = -float("inf"), ("speed", 0.0)
        self._sends_until = self._presses_from = self._safe_until = -float("inf")
        self._run: subprocess.Popen[bytes] | None = None
        self._starter = ThreadPoolExecutor(1)
        self._starter.submit(int).result()
        self._said: tuple[IO[bytes], IO[bytes]] | None = None

    # ---- what pages ask for

    def asked(self, page: object, asked: dict[str, Any]) -> str:
        """Do what a page asks; why not, or "". Raises ValueError, KeyError or TypeError for nonsense."""
        kind = asked["ask"]
        if kind == "arm":
            return self._arm(page) if asked["on"] else self.left(page)
        if kind == "hold":
            return self._hold(page, str(asked["mode"]), float(asked["value"]))
        if kind == "let_go":
            self._through.pop(page, None)
            self._held_at = -float("inf") if page is self._steers else self._held_at
            return ""
        if kind in ("start", "reset"):
            return self._start([] if kind == "start" else ["reset"])
        if kind == "stop":
            return self._stop()
        if kind == "safe_stop":
            self._end_hold()
            self._safe_until = self._clock() + SAFE_S
            rests = self._rests()
            self.source.tell(f"safe stop sent to all by this cockpit{f'; {rests}' if rests else ''}", "bad")
            return ""
        raise ValueError(kind)

    def _arm(self, page: object) -> str:
        if self.limits is None:
            return "the deployment file accepts no setpoints: [operator] accept = true"
        if self.limits.sources and "cockpit" not in self.limits.sources:
            return f"operator.sources of the deployment file must have cockpit; it has {', '.join(self.limits.sources)}"
        self._armed.add(page)
        return ""

    def left(self, page: object) -> str:
        if page in self._armed:
            self._armed.discard(page)
            self._sends_until = max(self._sends_until, self._clock() + PARTING_S)
        self._through.pop(page, None)
        if page is self._steers:
            self._steers, self._held_at = None, -float("inf")
        return ""

    def armed(self, page: object) -> bool:
        return page in self._armed

    def _hold(self, page: object, mode: str, value: float) -> str:
        now = self._clock()
        if page not in self._armed or mode not in ("speed", "position") or not abs(value) < 10.0:
            raise ValueError(mode)
        other = self._steers is not page and now - self._held_at <= HOLD_S
        if other or now - self._through.get(page, -float("inf")) <= HOLD_S:
            self._through[page] = now
            return _OTHER if other else _THROUGH
        self._steers, self._held_at, self._wanted = page, now, (mode, value)
        return ""

    def _start(self, action: list[str]) -> str:
        if self._run is not None:
            return "a run that was started here goes on"
        if self.source.watch.newest("ControllerHeartbeat") is not None:
            return "a controller leads already"
        out, error = tempfile.TemporaryFile(), tempfile.TemporaryFile()  # noqa: SIM115 - open until the run ends
        self._said = (out, error)
        words = [*own_module("hil.app.start"), "run", str(self.path), *action, "--json"]

        def begin() -> subprocess.Popen[bytes]:
            nothing = subprocess.DEVNULL
            return subprocess.Popen(
                words, stdin=nothing, stdout=out, stderr=error, start_new_session=True, env=own_environment()
            )

        self._run = self._starter.submit(begin).result()
        self.source.tell(f"{' '.join(['capsule run', *action])} started by this cockpit")
        return ""

    def _stop(self) -> str:
        self._end_hold()
        told = "controlled stop asked for by this cockpit"
        if self._run is not None:
            self._run.send_signal(signal.SIGINT)
            self.source.tell(told, "doubt")
            return ""
        if rests := self._rests():
            return f"{rests}, so nothing was sent"
        if self.limits is None or self.source.watch.newest(STATUS) is None:
            return "this controller takes no setpoints: Ctrl-C in its terminal, or a safe stop here"
        if self.limits.sources and "cockpit" not in self.limits.sources:
            return f"this controller takes setpoints of {', '.join(self.limits.sources)} alone: a safe stop stops it"
        self._presses_from = self._clock() + PARTING_S
        self._sends_until = self._presses_from + PRESS_S + PARTING_S
        self.source.tell(f"{told}: the drive is stopped, the run goes on; Ctrl-C in its terminal ends it", "doubt")
        return ""

    def _rests(self) -> str:
        """That nothing moves, "" where something may."""
        frame_map, watch = self.source.facts.frame_map, self.source.watch
        state = watch.state(frame_map.feedback) if watch.newest(frame_map.feedback) is not None else ""
        return f"nothing moves: {words(frame_map.node)} is in {words(state)}" if state in _RESTS else ""

    def _end_hold(self) -> None:
        """Whoever holds a button must let it go before it counts again."""
        if self._steers is not None:
            self._through[self._steers] = self._clock()
        self._held_at = -float("inf")

    # ---- what goes out

    def cycle(self) -> None:
        """Send what is due, and see what became of a run that was started."""
        now = self._clock()
        if now <= self._safe_until:
            self._stops.say("SafeStop", SAFE_STOP)
        if self._armed or now <= self._sends_until:
            self._send(now)
        if self._run is not None and self._run.poll() is not None:
            self._ended(self._run.returncode)

    def _send(self, now: float) -> None:
        mode, value = self._wanted
        if 0 <= now - self._presses_from <= PRESS_S:
            self._sender.speed(0.0)
        elif now - self._held_at > HOLD_S or now <= max(self._safe_until, self._presses_from):
            self._sender.release()
        elif mode == "speed":
            self._sender.speed(value)
        else:
            self._sender.position(value)

    def _ended(self, status: int) -> None:
        """Tell of the end of a run that was started here."""
        assert self._said is not None
        out, error = (_text(file) for file in self._said)
        self._run = self._said = None
        try:
            ended = str(json.loads(out)["ended"])
        except (ValueError, KeyError, TypeError):
            ended = (error.strip().splitlines() or [f"status {status}"])[-1].removeprefix("capsule: ")
        self.source.tell(f"capsule run ended: {ended}", "note" if status == 0 else "bad")

    def document(self, page: object) -> dict[str, Any]:
        answer = self.source.watch.newest(STATUS)
        limits = self.limits
        return {
            "armed": page in self._armed,
            "held": self._steers is page and self._clock() - self._held_at <= HOLD_S,
            "run": self._run is not None,
            "fault": self.source.watch.state(self.source.facts.frame_map.feedback) == "fault",
            "leads": self.source.watch.newest("ControllerHeartbeat") is not None,
            "answer": answer and [self.source.watch.state(STATUS, name) for name in ("State", "Source", "Refused")],
            "limits": limits and [1e3 * limits.speed_m_s, 1e3 * limits.lowest_m, 1e3 * limits.highest_m],
        }

    def close(self) -> None:
        """A run that was started here ends with the cockpit, by a controlled stop."""
        self._armed.clear()
        if self._run is not None:
            self._run.send_signal(signal.SIGINT)
            try:
                self._run.wait(ENDS_S)
            except subprocess.TimeoutExpired:
                self._run.kill()
                self._run.wait()
        self._starter.shutdown()
        for file in self._said or ():
            file.close()


def _text(file: IO[bytes]) -> str:
    with file:
        file.seek(0)
        return file.read(1 << 20).decode("utf-8", "replace")
