"""The operator panel on a bus that keeps what is sent, put into any state of the drive and of the run."""

import re
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from types import MappingProxyType
from typing import Any, Final, Self
from unittest.mock import patch

from hil.app.cockpit.operator_panel import OperatorPanel
from hil.app.cockpit.panels import Facts
from hil.app.cockpit.source import BusSource
from hil.app.cockpit.watch import FrameWatch
from hil.app.run.clock import Clock
from hil.bus.protection import Receiver, Sender
from hil.nodes.frame_map import FRAME_MAPS
from hil.nodes.operator import OperatorLimits
from tests.hil.app.cockpit.story import CATALOGUE
from tests.hil.scripted_bus import ScriptedBus

FACTS: Final = Facts("test", "", FRAME_MAPS["magnetic"], CATALOGUE)
DRIVES: Final = ("", "boot", "self_test", "standby", "ready", "enabled", "derated", "quick_stop", "fault")
"""States of the drive by their names; "" where it is not heard."""


@dataclass(frozen=True)
class RunState:
    """How far the run is that was `started` here ("" where none was), the state of the controller's heartbeat, its
    answer to setpoints as state and source, and whether the cockpit's deployment file accepts setpoints.
    """

    started: str = ""
    controller: str = ""
    answer: tuple[str, str] | None = None
    accepts: bool = True


RUNS: Final[Mapping[str, RunState]] = MappingProxyType(
    {
        "none": RunState(),
        "started here, begins": RunState("starting"),
        "started here, leads": RunState("leading", "running", ("ready", "nobody")),
        "started here, ends": RunState("ending", "stopping", ("off", "nobody")),
        "elsewhere, takes setpoints": RunState("", "running", ("ready", "nobody")),
        "elsewhere, a joystick steers": RunState("", "running", ("moving", "joystick")),
        "elsewhere, takes no setpoints": RunState("", "running"),
        "elsewhere, has stopped": RunState("", "fault", ("off", "nobody")),
        "none; `accept = false`": RunState(accepts=False),
        "started here, leads; `accept = false`": RunState("leading", "running", accepts=False),
        "started here, has stopped; `accept = false`": RunState("leading", "fault", accepts=False),
    }
)
BUTTONS: Final = ("start", "reset", "stop", "safe", "arm", "back", "forth", "go")


@dataclass(frozen=True)
class Pressed:
    """A button in a state: whether it counts, its tooltip, and after a press what goes out and what the page says."""

    counts: bool
    tip: str
    does: str = ""
    then: str = ""


@dataclass(frozen=True)
class Seen:
    """A state of the card: the buttons that are shown, and its two sentences."""

    buttons: Mapping[str, Pressed]
    words: str
    steering: str


Walk = Mapping[tuple[str, str], Seen]
"""By run and drive."""


class ActedRun:
    """In place of the process of a run: keeps its words and the signals that it gets."""

    def __init__(self, words: list[str], **_: Any) -> None:
        self.words, self.signals, self.returncode = words, list[int](), 0

    def __class_getitem__(cls, _: type) -> type[Self]:
        return cls

    def poll(self) -> None:
        return None

    def send_signal(self, number: int) -> None:
        self.signals.append(number)

    def wait(self, _: float | None = None) -> int:
        return 0


def settled(text: str) -> str:
    """A sentence without the name of the drive's state, so that states of which the same is said are one."""
    return re.sub(r"carriage is in [a-z ]+", "carriage is in ...", text)


class Stage:
    """A panel whose clock is set. Within `acted` no process is started."""

    def __init__(self, accepts: bool) -> None:
        self.now, self.bus = 0.0, ScriptedBus()
        self.source = BusSource(self.bus, Clock(), FACTS)
        limits = OperatorLimits(accept=True) if accepts else None
        self.panel = OperatorPanel(self.source, Path("rig.toml"), limits, lambda: self.now)

    def put(self, run: RunState, drive: str) -> None:
        """Nothing of before is remembered, but which pages are armed."""
        panel, self.source.watch = self.panel, FrameWatch(CATALOGUE)
        self.now += 10.0
        for file in panel._said or ():
            file.close()
        panel._run, panel._said, panel._through = None, None, {}
        panel._ending, panel._spoke = run.started == "ending", False
        if run.started:
            panel._run = ActedRun([])  # type: ignore[assignment]
            panel._said = (TemporaryFile(), TemporaryFile())  # noqa: SIM115 - the panel closes them
        if drive:
            self._hear("CarriageFeedback", State=drive)
        if run.controller:
            self._hear("ControllerHeartbeat", State=run.controller)
        if run.answer is not None:
            self._hear("OperatorStatus", State=run.answer[0], Source=run.answer[1])
        self.begin()

    def _hear(self, name: str, **named: str) -> None:
        frame = CATALOGUE[name]
        values = {field.name: 0.0 for field in frame.fields}
        values |= {signal: float(frame.field(signal).number(value)) for signal, value in named.items()}
        self.source.watch.take(0.0, frame.id, Sender(frame).frame(values))

    def begin(self) -> None:
        """Forget what was sent and said; what is pressed comes now."""
        self.bus.sent.clear()
        self.source.watch.events.clear()
        self._before = self.panel._run

    def outcome(self) -> tuple[str, str]:
        """What goes out in the next second, and what the page says."""
        for _ in range(50):
            self.panel.cycle()
            self.now += 0.02
        said = self.source.watch.events
        return self._sent(), settled(said[-1].words) if said else ""

    def _sent(self) -> str:
        run: Any = self.panel._run
        if run is not None and run is not self._before:
            return f"starts `capsule {' '.join(run.words[run.words.index('run') : -1])}`"
        if run is not None and run.signals:
            return "sends SIGINT to the run"
        names = {frame.id: name for name, frame in CATALOGUE.frames.items()}
        sent = {names[message.arbitration_id] for message in self.bus.sent}
        if "SafeStop" in sent:
            return "sends SafeStop to all drives"
        held = [values for values in self._setpoints() if values["DeadMan"]]
        if held and held[0]["Mode"]:
            return f"sends setpoints, held, {1e3 * held[0]['Velocity_m_s']:.2f} mm/s".replace("-", "−")
        if held:
            return f"sends setpoints, held, to {1e3 * held[0]['Position_m']:.2f} mm"
        return "sends setpoints, released" if sent else "sends nothing"

    def _setpoints(self) -> Iterator[dict[str, float]]:
        frame = CATALOGUE["OperatorSetpoint"]
        for message in self.bus.sent:
            if message.arbitration_id == frame.id:
                values = Receiver(frame).accept(message.data, 0.0)
                assert isinstance(values, dict)
                yield values

    def seen(self, buttons: Mapping[str, Pressed]) -> Seen:
        now = self.panel.document(None)
        return Seen(buttons, settled(now["words"]), settled(now["steering"]))


@contextmanager
def acted() -> Iterator[None]:
    """Runs are only acted for the time of the block."""
    with patch.object(subprocess, "Popen", ActedRun):
        yield
