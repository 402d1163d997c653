"""What a page with the token may do: start and stop a run, and steer with a dead-man switch."""

import json
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import IO, Any, Final

from hil.app.cockpit.buttons import ME, Situation
from hil.app.cockpit.phrases import TEXT, words
from hil.app.cockpit.source import BusSource
from hil.bus.protection import FrameTransmitter
from hil.nodes.operator import OperatorLimits
from hil.nodes.operator_sender import OperatorSender
from hil.own_process import own_environment, own_module
from models.words.quantities import fixed

HOLD_S: Final = 0.12  # How long a page's message that its button is held is valid; it comes every 40 ms
LIFE_MS: Final = 100.0  # for which a setpoint is valid
PARTING_S: Final = 0.2  # for which a release is sent
PRESS_S: Final = 0.15  # of a press that stops the drive
SAFE_S: Final = 0.5  # for which a safe stop is sent
SAFE_STOP: Final = {"Target": 0.0, "Reason": 0.0}  # of every drive, by an operator
ENDS_S: Final = 10.0  # in which a run ends after an interruption


class OperatorPanel:
    """Commands on the bus of `source`, deployed by `path`; with `limits` None no setpoints are accepted.

    `cycle` runs every 20 ms. While a page is armed it sends OperatorSetpoint, held only while the page that steers has
    confirmed its button within `HOLD_S`. A safe stop is SafeStop to all. A controlled stop is Ctrl-C to a run that was
    started here, and a short press at speed 0 to any other run. A button that was held through a stop, or while another
    page steered, must be released before it counts. A thread starts runs, with the niceness of the present process.
    """

    def __init__(
        self, source: BusSource, path: Path, limits: OperatorLimits | None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.source, self.path, self.limits = source, path, limits
        self._clock = clock
        self._sender = OperatorSender(source.bus, ME, LIFE_MS, clock)
        self._stops = FrameTransmitter(source.bus, ("SafeStop",))
        self._armed: set[object] = set()
        self._steers: object | None = None
        self._through: dict[object, float] = {}
        self._held_at, self._wanted = -float("inf"), ("speed", 0.0)
        self._sends_until = self._presses_from = self._safe_until = -float("inf")
        self._run: subprocess.Popen[bytes] | None = None
        self._ending, self._spoke, self._last = False, False, ""
        self._starter = ThreadPoolExecutor(1)
        self._starter.submit(int).result()
        self._said: tuple[IO[bytes], IO[bytes]] | None = None

    # ---- what pages ask for

    def asked(self, page: object, asked: dict[str, Any]) -> str:
        """Do what a page asks; why not, or "". Raises ValueError, KeyError or TypeError for malformed messages."""
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
            rests = self.situation().rests()
            self.source.say(TEXT("operator.safe_stop") + (f"; {rests}" if rests else ""), "bad")
            return ""
        raise ValueError(kind)

    def situation(self) -> Situation:
        frame_map, watch = self.source.facts.frame_map, self.source.watch
        drive, beat = (watch.state(n) if watch.newest(n) else "" for n in (frame_map.feedback, "ControllerHeartbeat"))
        self._spoke = self._run is not None and (self._spoke or bool(beat))
        ending = self._ending or beat == "fault" or (self._spoke and not beat)
        started = "" if self._run is None else "ending" if ending else "leading" if beat else "starting"
        return Situation(words(frame_map.node), drive, beat, started, watch.steering(), self.limits, self._last)

    def _refusal(self, button: str) -> str:
        counts, why = self.situation().buttons()[button]
        return "" if counts else why

    def _arm(self, page: object) -> str:
        refused = self._refusal("arm")
        if not refused:
            self._armed.add(page)
        return refused

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
            return TEXT("operator.other_page" if other else "operator.held_through")
        self._steers, self._held_at, self._wanted = page, now, (mode, value)
        return ""

    def _start(self, action: list[str]) -> str:
        if refused := self._refusal("start"):
            return refused
        out, error = tempfile.TemporaryFile(), tempfile.TemporaryFile()  # noqa: SIM115 - open until the run ends
        self._said = (out, error)
        words = [*own_module("hil.app.start"), "run", str(self.path), *action, "--json"]

        def begin() -> subprocess.Popen[bytes]:
            nothing = subprocess.DEVNULL
            return subprocess.Popen(
                words, stdin=nothing, stdout=out, stderr=error, start_new_session=True, env=own_environment()
            )

        self._run = self._starter.submit(begin).result()
        self.source.say(TEXT("operator.started", command=" ".join(["capsule run", *action])))
        return ""

    def _stop(self) -> str:
        """A second Ctrl-C would end the program before the drive rests: it is never sent."""
        self._end_hold()
        if refused := self._refusal("stop"):
            return refused
        if self._run is not None:
            self._ending = True
            self._run.send_signal(signal.SIGINT)
            self.source.say(TEXT("operator.stop"), "doubt")
            return ""
        self._presses_from = self._clock() + PARTING_S
        self._sends_until = self._presses_from + PRESS_S + PARTING_S
        self.source.say(TEXT("operator.press"), "doubt")
        return ""

    def _end_hold(self) -> None:
        """Require that a held button is released before it counts again."""
        if self._steers is not None:
            self._through[self._steers] = self._clock()
        self._held_at = -float("inf")

    # ---- what goes out

    def cycle(self) -> None:
        """Send what is due, and look whether a run that was started has ended."""
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
        assert self._said is not None
        out, error = (_text(file) for file in self._said)
        self._run, self._said, self._ending = None, None, False
        try:
            found = json.loads(out)
            ended = ": ".join(filter(None, (str(found["ended"]), str(found["remedy"]))))
        except (ValueError, KeyError, TypeError):
            ended = (error.strip().splitlines() or [f"status {status}"])[-1].removeprefix("capsule: ")
        self._last = ended
        self.source.say(TEXT("operator.ended", ended=ended), "note" if status == 0 else "bad")

    def document(self, page: object) -> dict[str, Any]:
        limits, now = self.limits, self.situation()
        ends = [1e3 * limits.lowest_m, 1e3 * limits.highest_m] if limits else [0.0, 0.0]
        return {
            "armed": page in self._armed,
            "held": self._steers is page and self._clock() - self._held_at <= HOLD_S,
            "run": bool(now.started),
            "buttons": now.buttons(),
            "resets": now.drive == "fault" and not now.controller and not now.started,
            "words": now.words(),
            "steering": now.steering(),
            "limits": limits and [1e3 * limits.speed_m_s, *ends],
            "range": limits and TEXT("operator.range", lowest=fixed(ends[0], 2), highest=fixed(ends[1], 2)),
        }

    def close(self) -> None:
        """End a run that was started here by a controlled stop."""
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
