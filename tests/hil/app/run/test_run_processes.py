"""`capsule run` and a plant in two processes in real time: it leads, a signal stops it, a dead plant ends it."""

import json
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.app.main import run
from hil.app.run.loop import StopSignals
from hil.bus.catalogue import load_catalogue
from hil.bus.local import LocalBus
from hil.log.reader import read_log_record
from hil.log.record import log_record
from models.rigs.rig import Rig
from tests.hil.app.run.deployments import deployment, rig_file
from tests.hil.app.run.forked import Forked
from tests.hil.app.run.plant_process import HELD_UP, REAL_TIME, RUN_S, TRIES, plant_on, truth_of


@pytest.fixture
def plant(tmp_path: Path, channel: str) -> Iterator[Forked]:
    with plant_on(tmp_path, channel) as child:
        yield child


def led(folder: Path, channel: str, log: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """What controller and plant say of one run in real time, of the first that was not held up."""
    rig = rig_file(folder, deployment(channel, control=REAL_TIME))
    for _ in range(TRIES):
        with plant_on(folder, channel) as plant:
            status, said, _ = Forked(folder, "run", rig, "--log", str(log), "--json").ended()
            found, truth = json.loads(said), truth_of(plant)
        assert status == (0 if found["ended"] == "done" else 1)
        if found["ended"] not in HELD_UP:
            break
    return found, truth


def leading(folder: Path, channel: str, frame: str, says: Callable[[bytearray], bool]) -> Forked:
    """`capsule run` for twenty seconds, once a `frame` on the bus `says` that it leads."""
    rig = rig_file(folder, deployment(channel, control="duration_s = 20.0\npriority = 20"))
    wanted = load_catalogue()[frame].id
    with LocalBus(channel) as receiver:
        child = Forked(folder, "run", rig, "--json")
        began = time.monotonic()
        while time.monotonic() - began < 20:
            message = receiver.recv(1)
            if message is not None and message.arbitration_id == wanted and says(message.data):
                break
    return child


def test_controller_and_plant_in_two_processes(
    tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """In real time: the capsule moves as asked, nothing is refused, and log, record and replay say the same."""
    log = tmp_path / "run.blf"
    found, truth = led(tmp_path, channel, log)
    assert run(["replay", str(log)]) == 0
    assert "identical" in capsys.readouterr().out
    assert found["ended"] == "done"
    assert found["ticks"] + found["missed_ticks"] > 0.93 * 500 * RUN_S
    assert found["refused"] == found["unsent"] == found["log_dropped"] == 0
    assert found["rejected"] <= 0.05 * found["ticks"]
    assert truth["moved_m"] == pytest.approx(2e-3 * RUN_S, abs=RUN_S * 1e-3)
    assert truth["fault"] == 0
    assert truth["state"] == 2
    record = log_record(log, Rig("magnetic"))
    assert record["position_m"][-20:].mean() == pytest.approx(truth["moved_m"], abs=1e-3)
    assert np.ptp(record["carriage_position_m"]) > 1e-3
    assert {"deployment", "controller", "values", "limits", "catalogue", "code"} <= set(read_log_record(log))


def test_a_signal_asks_for_a_controlled_stop(tmp_path: Path, channel: str, plant: Forked) -> None:
    child = leading(tmp_path, channel, "CarriageCommand", lambda data: (data[7] >> 2) & 3 == 2)
    child.send_signal(signal.SIGTERM)
    status, said, _ = child.ended()
    found, truth = json.loads(said), truth_of(plant)
    assert found["ended"] == "controlled stop (SIGTERM)" or found["ended"] in HELD_UP
    assert status == (0 if found["ended"] == "controlled stop (SIGTERM)" else 1)
    assert truth["fault"] == 0
    assert truth["state"] == 2


@pytest.mark.parametrize("seconds", [0.2, 1.0, 5.0])
def test_a_controller_that_is_stopped_for_a_while_says_for_how_long(
    tmp_path: Path, channel: str, plant: Forked, seconds: float
) -> None:
    """SIGSTOP and SIGCONT while the drive speaks on."""
    child = leading(tmp_path, channel, "CarriageCommand", lambda data: (data[7] >> 2) & 3 == 2)
    child.send_signal(signal.SIGSTOP)
    time.sleep(seconds)
    child.send_signal(signal.SIGCONT)
    status, said, _ = child.ended()
    found = json.loads(said)
    assert (found["end"], status) == ("stopped", 1)
    words, told_s = found["ended"].split(" for ")
    assert words == "controller paused"
    assert seconds <= float(told_s.removesuffix(" s")) * 1.06


def test_the_second_signal_ends_the_program_as_ever() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with StopSignals().caught() as signals:
        os.kill(os.getpid(), signal.SIGTERM)
        assert signals.wanted == "SIGTERM"
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    assert signal.getsignal(signal.SIGTERM) == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_ask_for_a_controlled_stop_and_ignored_ones_stay_so(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    try:
        signal.signal(number, signal.SIG_DFL)
        with StopSignals().caught() as signals:
            os.kill(os.getpid(), number)
            assert signals.wanted == number.name
        signal.signal(number, signal.SIG_IGN)
        with StopSignals().caught() as signals:
            os.kill(os.getpid(), number)
            assert signals.wanted == ""
    finally:
        signal.signal(number, before)


def test_a_second_plant_on_the_bus_is_the_reason_of_the_stop(tmp_path: Path, channel: str, plant: Forked) -> None:
    """Whatever its feedback made of the run first; and nothing is led then."""
    child = leading(tmp_path, channel, "CarriageFeedback", lambda data: (data[6] >> 2) & 15 == 4)
    (tmp_path / "second").mkdir()
    words = "two drives of the same kind are on the bus (CarriageHeartbeat has the uptimes of two)"
    with plant_on(tmp_path / "second", channel):
        found = json.loads(child.ended()[1])
        again = json.loads(Forked(tmp_path, "run", str(tmp_path / "rig.toml"), "--json").ended()[1])
    assert found["ended"].startswith(words) or found["ended"] in HELD_UP
    assert (again["end"], again["ended"]) == ("no_drive", f"nothing to lead: {words}")


def test_a_plant_that_dies_ends_the_run_with_a_reason(tmp_path: Path, channel: str, plant: Forked) -> None:
    child = leading(tmp_path, channel, "CarriageFeedback", lambda data: (data[6] >> 2) & 15 == 4)
    plant.kill()
    status, said, _ = child.ended()
    found = json.loads(said)
    assert status == 1
    assert found["ended"] in HELD_UP
