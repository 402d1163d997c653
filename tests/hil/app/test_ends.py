"""Every end that `tests.hil.app.docs.ends` declares is brought about by its command: status and sentence are those of
its row. An end without a case fails, and so does a case without an end.
"""

import json
import math
import os
import re
import resource
import shutil
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import can
import pytest

from controller.feedforward import Feedforward
from controller.signals import Action
from hil.app.cockpit.operator_panel import SAFE_STOP
from hil.app.main import run
from hil.app.run import check
from hil.app.run import run as run_module
from hil.app.run.clock import Histogram
from hil.app.sil.testbed import Bench
from hil.bus.catalogue import load_catalogue
from hil.bus.local import LocalBus
from hil.bus.protection import FrameTransmitter, Sender
from hil.log.blf_file import BlfFile
from hil.log.place import record_path
from hil.log.reader import read_frames
from hil.nodes.frame_map import ENABLED, FAULT
from hil.nodes.node import ControllerNode
from hil.simulated.medium import SimulatedBus
from tests.hil.app.docs.ends import ENDS, End, table
from tests.hil.app.run.deployments import PLANT, deployment, rig_file
from tests.hil.app.run.forked import Forked
from tests.hil.app.run.plant_process import plant_on
from tests.hil.app.run.test_run_ends import Lockstep, Rig
from tests.hil.app.sil.sil_runs import model_of, scenario_of
from tests.hil.app.test_streams import Started

SHORT: Final = PLANT.replace("duration_s = 60.0", "duration_s = 1.0")
QUICK: Final = "duration_s = 0.7\nprobe = false"
OPERATOR: Final = "[operator]\naccept = true\n"
LOST: Final = {"kind": "lost", "at_s": 0.001, "duration_s": 15.0}


@dataclass
class Stage:
    """Where a case plays."""

    folder: Path
    channel: str
    monkeypatch: pytest.MonkeyPatch
    capsys: pytest.CaptureFixture[str]

    def run(self, *words: str) -> tuple[int, str]:
        """A command in this process: its status and all that it said."""
        self.capsys.readouterr()
        status = run(words)
        return status, "".join(self.capsys.readouterr())

    def rig(self, control: str = QUICK, more: str = "") -> str:
        return rig_file(self.folder, deployment(self.channel, control=control, more=more))

    def written(self, name: str, text: str) -> str:
        (self.folder / name).write_text(text)
        return str(self.folder / name)

    def lead(
        self,
        *faults: Mapping[str, Any],
        each: Callable[[Rig], None] = lambda node: None,
        words: tuple[str, ...] = (),
        control: str = QUICK,
    ) -> tuple[int, str]:
        """`capsule run` on a simulated bus in simulated time, `each` before every tick: status and what `ended` says,
        `end` being the one of the case.
        """
        bench = Bench(scenario_of("magnetic", 20.0, *faults), model_of("magnetic"), "feedforward", 1)

        def node_of(task: Any, bus: can.BusABC, **more: Any) -> ControllerNode:
            node = Rig(task, bench.ports["controller"], **more)
            node.bench, node.each = bench, lambda now: each(node)
            return node

        self.monkeypatch.setattr(run_module, "drives_bus", lambda *_, **__: bench.ports["controller"])
        self.monkeypatch.setattr(run_module, "Clock", partial(Lockstep, bench))
        self.monkeypatch.setattr(run_module, "ControllerNode", node_of)
        log = self.folder / "log" / "run.blf"
        self.capsys.readouterr()
        status = run(["run", self.rig(control), *words, "--log", str(log), "--json"])
        found = json.loads(self.capsys.readouterr().out)
        return status, f"{found['end']}: {found['ended']}"


Case = Callable[[Stage], tuple[int, str]]


def _signalled(node: Rig, number: int) -> None:
    node.each = lambda now: None
    os.kill(os.getpid(), number)


def _when_enabled(node: Rig, do: Callable[[], None]) -> None:
    if node.receiver.state == ENABLED:
        node.each = lambda now: None
        do()


def _faulty(node: Rig, hot: bool = False) -> None:
    drive = node.bench.plant.drive
    drive.heated_to_C = 60.0 if hot else 0.0
    if node.receiver.state != FAULT and node.bench.time_s < 0.1:
        drive.stage = type(drive.stage)(FAULT, node.bench.time_s, 2 if hot else 4)
        drive._reports = 2


def _safe_stop(stage: Stage) -> tuple[int, str]:
    """The cockpit's button while the drive is enabled; the controller is the only one on the bus."""

    def press(node: Rig) -> None:
        bus = SimulatedBus(node.bench.medium, "cockpit")
        FrameTransmitter(bus, ["SafeStop"]).say("SafeStop", SAFE_STOP)

    return stage.lead(each=lambda node: _when_enabled(node, lambda: press(node)))


def _without_answers(node: Rig) -> None:
    """The controller asked for, in Python, fails once it leads, and the next one of its chain goes on."""
    if node.receiver.state == ENABLED:
        node.supervisor._chain[0].act = lambda *_: Action(math.nan, "failed")  # type: ignore[method-assign]


def _operator(stage: Stage) -> tuple[int, str]:
    return stage.lead(each=lambda node: _when_enabled(node, lambda: os.kill(os.getpid(), signal.SIGTERM)))


def _no_drive(stage: Stage) -> tuple[int, str]:
    status = run(["run", stage.rig(), "--log", str(stage.folder / "run.blf"), "--json"])
    found = json.loads(stage.capsys.readouterr().out)
    return status, f"{found['end']}: {found['ended']}"


def _log(stage: Stage) -> tuple[int, str]:
    folder = stage.folder / "log"
    return stage.lead(each=lambda node: _when_enabled(node, lambda: shutil.rmtree(folder)))


def _good(stage: Stage) -> tuple[int, str]:
    """Whatever this machine's speed is just now: one that holds the plant up, so that frames come too late, has more
    tries.
    """
    stage.monkeypatch.setattr(check, "rehearse", lambda *_: Histogram())
    with plant_on(stage.folder, stage.channel):
        for _ in range(5):
            found = stage.run("run", stage.rig(), "check")
            if found[0] == 0:
                break
    return found


@contextmanager
def _answering(channel: str) -> Iterator[None]:
    """A controller that says on the bus who steers it."""
    frame, over = load_catalogue()["OperatorStatus"], threading.Event()
    sender = Sender(frame)
    values = {"State": 2, "Source": 5, "Refused": 0, "Position_m": 0.001, "Velocity_m_s": 0.0}

    def speak() -> None:
        with LocalBus(channel) as bus:
            while not over.wait(0.02):
                bus.send(can.Message(arbitration_id=frame.id, is_extended_id=False, data=sender.frame(values)))

    speaker = threading.Thread(target=speak)
    speaker.start()
    try:
        yield
    finally:
        over.set()
        speaker.join()


def _jog(stage: Stage) -> tuple[int, str]:
    words = ("--script", stage.written("script.txt", "speed 3 0.2\n"), "--source", "script")
    return stage.run("jog", stage.rig(more=OPERATOR), *words)


def _answered(stage: Stage) -> tuple[int, str]:
    with _answering(stage.channel):
        return _jog(stage)


def _plant(stage: Stage) -> tuple[int, str]:
    stage.written("plant.toml", PLANT)
    file = stage.written("deployed.toml", deployment(stage.channel, more='[plant]\nscenario = "plant.toml"\n'))
    return stage.run("plant", file, "--seconds", "0.2")


def _sil(stage: Stage, more: str = "", *words: str) -> tuple[int, str]:
    return stage.run("sil", stage.written("scenario.toml", SHORT + more), *words)


def _by_another(stage: Stage) -> tuple[int, str]:
    stage.monkeypatch.setenv("CAPSULE_COMPILER", "none")
    return stage.lead(each=_without_answers)


def _sil_by_another(stage: Stage) -> tuple[int, str]:
    stage.monkeypatch.setenv("CAPSULE_COMPILER", "none")
    stage.monkeypatch.setattr(Feedforward, "act", lambda *_: Action(math.nan, "failed"))
    return _sil(stage)


def _replayed(stage: Stage, spoil: Callable[[Path], None]) -> tuple[int, str]:
    _sil(stage, "", "--out", str(stage.folder / "out"))
    log = stage.folder / "out" / "frames.blf"
    spoil(log)
    return stage.run("replay", str(log))


def _other_controller_of(log: Path) -> None:
    record = json.loads(record_path(log).read_text())
    record_path(log).write_text(json.dumps({**record, "controller": "pid"}))


def _cut(log: Path) -> None:
    """Cut off where a block ends, as python-can writes it."""
    frames, file = list(read_frames(log)), BlfFile(log)
    for frame in frames[: len(frames) // 2]:
        file.write(frame)
    file.stop()


def _cockpit(stage: Stage) -> tuple[int, str]:
    pytest.importorskip("tornado", reason="needs tornado (extra `cockpit`)")
    child = Forked(stage.folder, "cockpit", stage.rig(), "--port", "0")
    until = time.monotonic() + 60
    while "Ctrl-C" not in child.files[0].read_text() and time.monotonic() < until:
        time.sleep(0.05)
    child.send_signal(signal.SIGTERM)
    status, said, _ = child.ended()
    return status, said


def _interrupted(stage: Stage) -> tuple[int, str]:
    child = Forked(stage.folder, "sil", stage.written("scenario.toml", PLANT))
    until = time.monotonic() + 60
    while "%" not in child.files[1].read_text() and time.monotonic() < until:
        time.sleep(0.05)
    child.send_signal(signal.SIGINT)
    status, _, said = child.ended()
    return status, said


def _unwritten(stage: Stage) -> tuple[int, str]:
    return Started(stage.folder, "seeds", out="full").ended()[::2]


def _short(stage: Stage) -> tuple[int, str]:
    before = resource.getrlimit(resource.RLIMIT_AS)
    stage.monkeypatch.setattr(resource, "getrlimit", lambda what: (1 << 28, before[1]))
    stage.monkeypatch.setattr("sys.argv", ["capsule", "seeds"])
    from hil.app.start import _status

    stage.capsys.readouterr()
    return _status(["seeds"]), stage.capsys.readouterr().err


CASES: Final[Mapping[tuple[str, str], Case]] = MappingProxyType(
    {
        ("run", "done"): lambda stage: stage.lead(),
        ("run", "operator"): _operator,
        ("run", "reset"): lambda stage: stage.lead(each=_faulty, words=("reset",)),
        ("run", "cancelled"): lambda stage: stage.lead(each=lambda node: _signalled(node, signal.SIGTERM)),
        ("run", "other_controller"): lambda stage: stage.lead(
            {"kind": "second_master", "at_s": 1.0, "duration_s": 0.2}, control="duration_s = 2.0\nprobe = false"
        ),
        ("run", "no_drive"): _no_drive,
        ("run", "drive_fault"): lambda stage: stage.lead(each=_faulty),
        ("run", "not_reset"): lambda stage: stage.lead(each=partial(_faulty, hot=True), words=("reset",)),
        ("run", "gave_up"): lambda stage: stage.lead(LOST, control=f"{QUICK}\ngive_up_s = 1.0"),
        ("run", "stopped"): lambda stage: stage.lead(
            {"kind": "lost", "at_s": 1.0, "duration_s": 1.0}, control="duration_s = 2.0\nprobe = false"
        ),
        ("run", "sensor_or_drive"): lambda stage: stage.lead(
            {"kind": "held", "target": "drive", "at_s": 0.0, "duration_s": 20.0}, control="duration_s = 0.7"
        ),
        ("run", "no_rest"): lambda stage: stage.lead(
            {"kind": "restless", "target": "drive", "at_s": 0.0, "duration_s": 20.0}
        ),
        ("run", "safe_stop"): _safe_stop,
        ("run", "not_led"): _by_another,
        ("run", "log"): _log,
        ("run check", "good"): _good,
        ("run check", "bad"): lambda stage: stage.run("run", stage.rig(), "check"),
        ("jog", "answered"): _answered,
        ("jog", "unanswered"): _jog,
        ("plant", "over"): _plant,
        ("sil", "done"): _sil,
        ("sil", "not_led"): _sil_by_another,
        ("sil", "stopped"): lambda stage: _sil(
            stage, '[[faults]]\nkind = "clock_jump"\nat_s = 0.7\nduration_s = 0.1\n'
        ),
        ("replay", "identical"): lambda stage: _replayed(stage, lambda log: None),
        ("replay", "different"): lambda stage: _replayed(stage, _other_controller_of),
        ("replay", "cut_off"): lambda stage: _replayed(stage, _cut),
        ("cockpit", "closed"): _cockpit,
        ("each of them", "refused"): lambda stage: stage.run(
            "sil", stage.written("bad.toml", "[scenario]\nseed = -1\n")
        ),
        ("each of them", "short"): _short,
        ("each of them", "unwritten"): _unwritten,
        ("each of them", "interrupted"): _interrupted,
    }
)
ALL: Final = [(command, name) for command, ends in ENDS.items() for name in ends]


def as_pattern(sentence: str) -> re.Pattern[str]:
    """A line that says `sentence`."""
    words = ".*".join(re.escape(part) for part in sentence.split("..."))
    return re.compile(rf"^{words}$", re.MULTILINE)


@pytest.mark.parametrize("which", ALL, ids=lambda which: " ".join(which))
def test_an_end_is_brought_about(
    which: tuple[str, str],
    tmp_path: Path,
    channel: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    command, name = which
    assert which in CASES, f"end {name!r} of 'capsule {command}' must have a case in CASES of {__file__}; it has none"
    end: End = ENDS[command][name]
    status, said = CASES[which](Stage(tmp_path, channel, monkeypatch, capsys))
    sentence = f"{name}: {end.sentence}" if command == "run" else end.sentence
    assert as_pattern(sentence).search(said), f"must say {sentence!r}; said {said!r}"
    assert status == end.status, said


def test_every_case_is_of_an_end_that_is_declared() -> None:
    assert sorted(set(CASES) - set(ALL)) == []


def test_the_table_has_a_row_for_each_end() -> None:
    assert len(table().splitlines()) == 2 + len(ALL)
