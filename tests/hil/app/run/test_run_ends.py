"""How a run ends, led by the loop of `capsule run` on a simulated bus, in simulated time: nothing depends on the
machine.
"""

import json
import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest

from hil.app.main import run
from hil.app.run.clock import Clock
from hil.app.run.loop import Outcome, StopSignals, lead, reset
from hil.app.run.replay import replayed
from hil.app.sil.testbed import Bench
from hil.bus.catalogue import load_catalogue
from hil.bus.local import LocalBus
from hil.bus.protection import Sender
from hil.log.blf_file import NOTED, SENT
from hil.log.log import LockstepLog
from hil.log.reader import read_frames
from hil.log.recorder import Recorder
from hil.nodes.frame_map import ENABLED, FAULT, STANDBY
from hil.nodes.node import ControllerNode, NodeTick
from hil.nodes.operator import OperatorLimits
from plant import layout as at
from tests.hil.app.docs.ends import RUN_ENDS
from tests.hil.app.run.deployments import deployment, rig_file
from tests.hil.app.sil.sil_runs import model_of, scenario_of


class Rig(ControllerNode):
    """Time, and the plant on the simulated bus, go on with the controller's ticks; `each` is called before a tick."""

    bench: Bench
    each: Callable[[float], None]

    def tick(self, now: float, solved: bool = True) -> NodeTick:
        """One tick, then the rest of it on the wire."""
        self.each(now)
        self.bench._change(now)
        done = super().tick(now, solved)
        for number in range(self.bench.slots):
            self.bench.slot(number)
        self.bench.end_tick()
        return done


class Lockstep(Clock):
    """The bench's time."""

    def __init__(self, bench: Bench) -> None:
        super().__init__()
        self.bench = bench

    def now(self) -> float:
        """The begin of the next tick."""
        return self.bench.time_s


def rig_of(
    log: Recorder | None,
    *faults: Mapping[str, Any],
    kind: str = "magnetic",
    operator: OperatorLimits | None = None,
    **tables: Any,
) -> tuple[Rig, Clock]:
    """A controller that nobody has started, and its clock."""
    bench = Bench(scenario_of(kind, 20.0, *faults, **tables), model_of(kind), "feedforward", 1)
    own = bench.node
    node = Rig(replace(own.task, operator=operator), bench.ports["controller"], observer=log)
    node.bench, node.each = bench, lambda now: None
    return node, Lockstep(bench)


def led(
    folder: Path,
    *faults: Mapping[str, Any],
    each: Callable[[Rig, StopSignals, float], None] | None = None,
    seconds: float = 1.0,
    **more: Any,
) -> tuple[Outcome, Rig]:
    """A run of one second (or `seconds`), and its log replayed: identical."""
    signals = StopSignals()
    task = None
    with LockstepLog(folder / "run.blf", {}) as log:
        recorder = Recorder(log)
        node, clock = rig_of(recorder, *faults, **more)
        task = node.task
        if each is not None:
            node.each = lambda now: each(node, signals, now)
        outcome = lead(node, clock, seconds, recorder, signals, 3.0)
    frames = list(read_frames(folder / "run.blf"))
    times = [frame.time_ns for frame in frames]
    assert times == sorted(times), "in order of time"
    found = replayed(frames, task, load_catalogue())
    assert found.identical
    assert found.ticks == outcome.grid.ticks or node.guard.unsent, "a tick that the bus did not take is none of the log"
    return outcome, node


def carriage_speeds(node: Rig) -> Any:
    rows = np.concatenate(node.bench.plant.session.rows)
    return rows[:, at.O_T], rows[:, at.O_X]


def test_a_run_that_leads_to_its_end(tmp_path: Path) -> None:
    outcome, node = led(tmp_path)
    assert (outcome.end, outcome.ended, outcome.led, RUN_ENDS[outcome.end].status) == ("done", "done", True, 0)
    assert node.bench.plant.drive.safe


def test_a_localisation_that_comes_late_finds_the_reference_waiting(tmp_path: Path) -> None:
    """The reference begins where the capsule is when the drive is enabled, and the carriage begins slowly."""
    outcome, node = led(
        tmp_path, {"kind": "lost", "at_s": 0.001, "duration_s": 2.0}, reference={"kind": "ramp", "speed_mm_s": 5.0}
    )
    assert outcome.end == "done"
    t, x = carriage_speeds(node)
    assert np.max(np.abs(x[t < 2.0] - x[0])) < 1e-4
    speed = np.abs(np.gradient(x, t))
    assert np.max(np.convolve(speed, np.full(50, 0.02), "same")) < 0.05
    assert x[-1] - x[0] == pytest.approx(2.5e-3, abs=2e-3)
    commands = [f for f in read_frames(tmp_path / "run.blf") if f.direction == SENT and f.id == 0x100]
    values = [int.from_bytes(f.data, "little") for f in commands]
    enabled = [k for k, v in enumerate(values) if v >> 58 & 3 == 2]
    places = [(v >> 12 & 0xFFFFFF) - ((v >> 35 & 1) << 24) for v in values]
    steps = np.abs(np.diff([2e-7 * places[k] for k in enabled]))
    since = 2e-3 * np.arange(1, len(steps) + 1)
    assert np.all(steps <= 2e-3 * (0.02 + 0.25 * since) + 1e-6)


def test_a_localisation_that_never_comes_is_given_up(tmp_path: Path) -> None:
    outcome, node = led(tmp_path, {"kind": "lost", "at_s": 0.001, "duration_s": 15.0})
    assert (outcome.end, outcome.led, RUN_ENDS[outcome.end].status) == ("gave_up", False, 1)
    assert outcome.ended.startswith("gave up: the drive was not enabled within 3 s: ")
    assert node.bench.plant.drive.safe


def test_signals_before_and_after_the_drive_is_enabled(tmp_path: Path) -> None:
    def soon(node: Rig, signals: StopSignals, now: float) -> None:
        signals.wanted = "SIGTERM"

    def later(node: Rig, signals: StopSignals, now: float) -> None:
        signals.wanted = "SIGHUP" if node.receiver.state == ENABLED else ""

    assert led(tmp_path, each=soon)[0].end == "cancelled"
    outcome, _ = led(tmp_path, each=later)
    assert (outcome.end, outcome.ended, RUN_ENDS[outcome.end].status) == ("operator", "controlled stop (SIGHUP)", 0)


def test_another_controller_ends_it(tmp_path: Path) -> None:
    before, _ = led(tmp_path, {"kind": "second_master", "at_s": 0.001, "duration_s": 1.0})
    assert (before.end, before.led) == ("other_controller", False)
    during, node = led(tmp_path, {"kind": "second_master", "at_s": 1.0, "duration_s": 0.2})
    assert (during.end, during.led, RUN_ENDS[during.end].status) == ("other_controller", True, 1)
    assert during.ended.startswith("another controller is on the bus (")
    assert node.bench.plant.drive.safe


def test_a_fault_is_not_led_and_reset_only_resets(tmp_path: Path) -> None:
    """A drive whose first controller fell silent: refused, then acknowledged; nothing moves. One without is left."""
    node, clock = rig_of(None)
    with LockstepLog(tmp_path / "a.blf", {}) as log:
        recorder = Recorder(log)
        healthy = reset(node, clock, recorder, StopSignals())
        assert (healthy.end, healthy.ended) == ("reset", "the drive has no fault to acknowledge")
        assert lead(node, clock, 0.2, recorder, StopSignals()).end == "done"
        node.bench.plant.drive.stage = type(node.bench.plant.drive.stage)(FAULT, node.bench.time_s, 4)
        node.bench.plant.drive._reports = 2
        refused = lead(node, clock, 0.2, recorder, StopSignals())
        assert (refused.end, refused.led) == ("drive_fault", False)
        assert (
            refused.ended
            == "nothing to lead: drive fault 4 (time to live); 'capsule run RIG.toml reset' acknowledges it"
        )
        states = set[int]()
        node.each = lambda now: states.add(node.receiver.state)
        done = reset(node, clock, recorder, StopSignals())
        assert (done.end, done.ended) == ("reset", "drive fault 4 is acknowledged; the drive is in standby")
        assert states <= {FAULT, STANDBY}
        node.bench.plant.drive.heated_to_C = 60.0
        until = node.bench.time_s + 0.5
        while node.bench.time_s < until:
            node.tick(node.bench.time_s)
        stays = reset(node, clock, recorder, StopSignals())
        assert (stays.end, RUN_ENDS[stays.end].status) == ("not_reset", 1)
        assert stays.ended == "drive fault 2 stays: its cause is still there"


@pytest.mark.parametrize("quantum", [0.25e-3, 1e-3])
def test_a_coarse_localiser_is_led(tmp_path: Path, quantum: float) -> None:
    outcome, node = led(tmp_path, localisation={"quantum": quantum})
    assert node.task.resolution_m == pytest.approx(quantum)
    assert outcome.end == "done"


def test_beside_another_controller_nothing_is_sent(
    tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """`capsule run` and `reset` end with status 1 before they say anything; `check` says BAD."""
    catalogue, over = load_catalogue(), threading.Event()
    sync, heard = Sender(catalogue["Sync"]), list[int]()

    def speak() -> None:
        with LocalBus(channel) as other:
            for tick in range(1 << 30):
                data = sync.frame({"Tick": tick, "Period_s": 2e-3})
                other.send(can.Message(arbitration_id=catalogue["Sync"].id, is_extended_id=False, data=data))
                while (message := other.recv(0)) is not None:
                    heard.append(message.arbitration_id)
                if over.wait(2e-3):
                    return

    speaker = threading.Thread(target=speak)
    speaker.start()
    try:
        time.sleep(0.1)
        rig, log = rig_file(tmp_path, deployment(channel)), str(tmp_path / "run.blf")
        for words in ([], ["reset"]):
            assert run(["run", rig, *words, "--log", log, "--json"]) == 1
            found = json.loads(capsys.readouterr().out)
            assert (found["end"], found["led"]) == ("other_controller", False)
            assert found["ended"] == "nothing to lead: another controller is on the bus (Sync)"
        assert run(["run", rig, "check", "--json"]) == 1
        points = {point["what"]: point for point in json.loads(capsys.readouterr().out)["points"]}
        assert not points["bus"]["good"]
        assert "another controller is on the bus (Sync)" in points["bus"]["words"]
    finally:
        over.set()
        speaker.join()
    assert heard == []


def test_a_log_says_when_frames_are_missing(tmp_path: Path) -> None:
    """Notes of a log name what a replay needs; one of missing frames refuses it."""
    led(tmp_path)
    frames = list(read_frames(tmp_path / "run.blf"))
    assert [f for f in frames if f.direction == NOTED]
    starts = [f for f in frames if f.direction == NOTED and f.id == 1]
    assert len(starts) == 1
    assert math.isnan(np.frombuffer(starts[0].data)[0])
