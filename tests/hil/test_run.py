"""`capsule run`: files, clock, pacing, checks, and the controller and a plant in two processes in real time."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.app.can_record import log_record
from hil.app.main import run
from hil.app.run_check import rehearse
from hil.app.run_clock import Clock, ClockedBus, Grid, Histogram
from hil.app.run_file import load_deployment, parse_deployment
from hil.app.run_loop import Signals
from hil.bus.catalogue import load_catalogue
from hil.bus.local import LocalBus
from hil.bus.log_reading import read_log_record
from hil.bus.protection import Sender
from models.rig import Rig
from tests.hil.deployments import PLANT, deployment


@contextmanager
def plant_on(folder: Path, channel: str) -> Iterator[subprocess.Popen[str]]:
    """A plant in a process of its own."""
    scenario = folder / "plant.toml"
    scenario.write_text(PLANT)
    command = [sys.executable, "-m", "hil.app.run_plant", str(scenario), "capsule_local", channel, "30", "20"]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    assert child.stdout.readline() == "ready\n"
    yield child
    if child.returncode is None:
        child.kill()
        child.communicate()


@pytest.fixture
def plant(tmp_path: Path, channel: str) -> Iterator[subprocess.Popen[str]]:
    with plant_on(tmp_path, channel) as child:
        yield child


def rig_file(folder: Path, text: str) -> str:
    path = folder / "rig.toml"
    path.write_text(text)
    return str(path)


REAL_TIME = "duration_s = 1.5\npriority = 20"
"""With SCHED_FIFO where the system allows it: these tests run beside others."""
HELD_UP = (
    "controller paused",
    "clock jumped",
    "feedback lost",
    "drive heartbeat lost",
    "drive left operation",
    "localisation lost",
    "drive not enabled",
)
TRIES = 3


def truth_of(plant: subprocess.Popen[str]) -> dict[str, float]:
    plant.terminate()
    return json.loads(plant.communicate()[0])


def led(folder: Path, channel: str, log: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """What controller and plant say of one run in real time. A machine that holds a process up for longer than a command
    lives ends a run; that is right, and the run is done again."""
    command = [sys.executable, "-m", "hil.app.main", "run", rig_file(folder, deployment(channel, control=REAL_TIME))]
    for _ in range(TRIES):
        with plant_on(folder, channel) as plant:
            done = subprocess.run([*command, "--log", str(log), "--json"], capture_output=True, text=True, check=False)
            found, truth = json.loads(done.stdout), truth_of(plant)
        assert done.returncode == (0 if found["ended"] == "time is up" else 1)
        if found["ended"] not in HELD_UP:
            break
    return found, truth


def test_controller_and_plant_in_two_processes(tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]) -> None:
    """In real time: the capsule moves as asked, nothing is refused, and log, record and replay say the same."""
    log = tmp_path / "run.blf"
    found, truth = led(tmp_path, channel, log)
    assert run(["replay", str(log)]) == 0
    assert "identical" in capsys.readouterr().out
    assert found["ended"] == "time is up"
    assert found["ticks"] + found["missed_ticks"] > 700
    assert found["refused"] == found["unsent"] == found["log_dropped"] == 0
    assert found["rejected"] <= 0.05 * found["ticks"]
    assert truth["moved_m"] == pytest.approx(2e-3 * 1.5, abs=1.5e-3)
    assert truth["fault"] == 0
    assert truth["state"] == 2
    record = log_record(log, Rig("magnetic"))
    assert record["position_m"][-20:].mean() == pytest.approx(truth["moved_m"], abs=1e-3)
    assert np.ptp(record["carriage_position_m"]) > 1e-3
    assert {"deployment", "controller", "values", "limits", "catalogue", "code"} <= set(read_log_record(log))


def test_a_signal_asks_for_a_controlled_stop(tmp_path: Path, channel: str, plant: subprocess.Popen[str]) -> None:
    control = "duration_s = 20.0\npriority = 20"
    command = [sys.executable, "-m", "hil.app.main", "run", rig_file(tmp_path, deployment(channel, control=control)), "--json"]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path, env=_environment())
    with LocalBus(channel) as ears:
        enabled = load_catalogue()["CarriageCommand"].id
        began = time.monotonic()
        while time.monotonic() - began < 20:
            message = ears.recv(1)
            if message is not None and message.arbitration_id == enabled and (message.data[7] >> 2) & 3 == 2:
                break
        child.send_signal(signal.SIGTERM)
        found = json.loads(child.communicate(timeout=20)[0])
    truth = truth_of(plant)
    assert found["ended"] in ("SIGTERM", *HELD_UP)
    assert child.returncode == (0 if found["ended"] == "SIGTERM" else 1)
    assert truth["fault"] == 0
    assert truth["state"] == 2


def test_a_plant_that_dies_ends_the_run_with_a_reason(tmp_path: Path, channel: str, plant: subprocess.Popen[str]) -> None:
    control = "duration_s = 20.0\npriority = 20"
    command = [sys.executable, "-m", "hil.app.main", "run", rig_file(tmp_path, deployment(channel, control=control)), "--json"]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path, env=_environment())
    with LocalBus(channel) as ears:
        feedback = load_catalogue()["CarriageFeedback"].id
        began = time.monotonic()
        while time.monotonic() - began < 20:
            message = ears.recv(1)
            if message is not None and message.arbitration_id == feedback and ((message.data[6] >> 2) & 15) == 4:
                break
    plant.kill()
    found = json.loads(child.communicate(timeout=20)[0])
    assert child.returncode == 1
    assert found["ended"] in HELD_UP


def test_a_dry_run_sends_nothing(tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]) -> None:
    with LocalBus(channel) as ears:
        log = tmp_path / "dry.blf"
        assert run(["run", rig_file(tmp_path, deployment(channel)), "--dry-run", "--log", str(log), "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["ended"] == "nothing to lead: no feedback of the drive"
        assert ears.recv(0) is None
    assert run(["replay", str(log)]) == 0


@pytest.mark.parametrize(
    ("other", "fault", "words"),
    [(1, 0, "drive knows another DBC"), (0, 4, "drive fault 4; 'capsule run RIG.toml reset' acknowledges it")],
)
def test_a_drive_with_another_dbc_or_a_fault_is_not_led(
    tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str], other: int, fault: int, words: str
) -> None:
    """Its heartbeat carries the fingerprint of the file it knows; a latched fault takes an operator's word."""
    catalogue = load_catalogue()
    speakers = {name: Sender(catalogue[name]) for name in ("CarriageHeartbeat", "CarriageFeedback", "CarriageFault")}
    told: dict[str, dict[str, float]] = {
        "CarriageHeartbeat": {"State": 1, "Uptime_s": 0.0, "Catalogue": catalogue.fingerprint ^ other},
        "CarriageFeedback": {"Position_m": 0.0, "Velocity_m_s": 0.0, "State": 7 if fault else 2, "Temperature_degC": 25.0},
    }
    told |= {"CarriageFault": {"Code": fault, "Detail": 0}} if fault else {}
    over = threading.Event()

    def speak() -> None:
        with LocalBus(channel) as drive:
            while not over.wait(0.005):
                for frame, values in told.items():
                    data = speakers[frame].frame(values)
                    drive.send(can.Message(arbitration_id=catalogue[frame].id, is_extended_id=False, data=data))

    drive = threading.Thread(target=speak)
    drive.start()
    try:
        assert run(["run", rig_file(tmp_path, deployment(channel)), "--log", str(tmp_path / "log.blf"), "--json"]) == 1
    finally:
        over.set()
        drive.join()
    assert json.loads(capsys.readouterr().out)["ended"] == f"nothing to lead: {words}"


def test_check_says_what_is_missing(tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = deployment(channel, more="[limits]\ncarriage_speed_m_s = 0.5\n")
    assert run(["run", rig_file(tmp_path, text), "check", "--json"]) == 1
    found = {point["what"]: point for point in json.loads(capsys.readouterr().out)["points"]}
    assert not found["bus"]["good"]
    assert not found["drive Carriage"]["good"]
    assert "carriage_speed_m_s must be at most 0.4" in found["limits"]["words"]
    assert found["model"]["good"]
    assert "p99" in found["time"]["words"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (deployment(interface="socketcn"), "bus.interface must be one of"),
        (deployment(interface="socketcan", channel="nocan9"), "bus must be one that opens; got socketcan 'nocan9'"),
        (deployment(channel="y" * 150), "bus must be one that opens"),
        (deployment(interface="pcan"), "bus must be one that opens; got pcan"),
        (deployment(control="tick_s = 0.5"), "control.tick_s must lie in"),
        (deployment(control="core = -2"), "control.core must be a core's number"),
        (deployment(more="[limits]\ncarriage_speed_m_s = 0.5\n"), "carriage_speed_m_s must be at most 0.4"),
        (deployment(control="duratoin_s = 1"), "did you mean"),
        (deployment(control='controller = "mpcc"'), "controller must be one of"),
        (deployment(more="[bis]"), "tables must be among"),
        (deployment(more='[model]\nfile = "no.toml"\nreport = "no.json"'), "model must be a file"),
        (deployment().replace("[bus]", "[bus]\nbitrate = 500000"), "bus.bitrate must be 1000000"),
        (deployment().replace('kind = "magnetic"', 'kind = "pull"'), "must not"),
        ("x", "rig file must be TOML"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(
    tmp_path: Path, text: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["run", rig_file(tmp_path, text)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    if sentence != "must not":
        assert sentence in said
    assert run(["run", str(tmp_path / "none.toml")]) == 2
    assert run(["run", rig_file(tmp_path, deployment()), "chek"]) == 2
    assert "did you mean 'check'" in capsys.readouterr().err


def test_a_model_leads_only_through_the_gate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "model.toml").write_text(_MODEL)
    (tmp_path / "report.json").write_text('{"kind": "magnetic", "error": {"holdout": {"calibrated": 1.0, "augmented": 2.0}}}')
    text = deployment(more='[model]\nfile = "model.toml"\nreport = "report.json"\n')
    loaded = load_deployment(Path(rig_file(tmp_path, text)))
    assert loaded.verdict is not None
    assert not loaded.verdict.passed
    assert run(["run", rig_file(tmp_path, text)]) == 2
    assert "must pass the gate" in capsys.readouterr().err
    (tmp_path / "report.json").write_text('{"kind": "magnetic", "error": {"holdout": {"calibrated": 1.0, "augmented": 0.5}}}')
    loaded = load_deployment(Path(rig_file(tmp_path, text)))
    assert loaded.verdict is not None
    assert loaded.verdict.passed


_MODEL = """format = 1
kind = "magnetic"
[nominal]
friction_coefficient = 0.082
[calibrated]
friction_coefficient = 0.085
[augmented]
friction_coefficient = 0.085
"""


def test_rehearsal_runs_every_controller_of_the_rig() -> None:
    for name in ("feedforward", "mpc"):
        task = parse_deployment(deployment(control=f'controller = "{name}"'), {}).task()
        took = rehearse(task, load_catalogue(), 120)
        assert 0 < took.quantile(0.5) <= took.longest_s


@given(st.lists(st.floats(0, 0.019), min_size=1, max_size=200), st.floats(0.01, 1))
def test_quantiles_are_those_of_the_numbers(seconds: list[float], share: float) -> None:
    histogram = Histogram()
    for one in seconds:
        histogram.add(one)
    exact = float(np.quantile(seconds, share, method="inverted_cdf"))
    assert exact - 1e-12 <= histogram.quantile(share) <= exact + 2e-6
    assert histogram.longest_s == max(seconds)


def test_the_grid_skips_what_it_missed() -> None:
    grid = Grid(Clock(), 0.002)
    first = grid.wait()
    time.sleep(0.0205)
    late = grid.wait()
    assert late - first > 0.02
    assert grid.missed >= 9
    points = (grid.wait() - first) / 0.002
    assert points >= grid.missed + 2
    assert grid.ticks == 3


def test_stamps_are_of_the_nodes_clock(channel: str) -> None:
    """A driver's stamp counts while it is plausible; a step of the calendar's clock does not reach the node."""
    with LocalBus(channel) as far, ClockedBus(LocalBus(channel), Clock()) as near:
        far.send(can.Message(arbitration_id=1, is_extended_id=False))
        time.sleep(0.02)
        got = near.recv(1)
        assert got is not None
        assert near.clock.now() - got.timestamp >= 0.02
        near.inner._inbox.append(can.Message(time.time() + 3600, 1, False, is_rx=False))  # type: ignore[attr-defined]
        odd = near.recv(1)
        assert odd is not None
        assert odd.is_rx
        assert abs(odd.timestamp - near.clock.now()) < 0.1
        assert near.unstamped == 1
        assert round(got.timestamp * 1e9) / 1e9 == got.timestamp


def test_the_second_signal_ends_the_program_as_ever() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with Signals().caught() as signals:
        os.kill(os.getpid(), signal.SIGTERM)
        assert signals.wanted == "SIGTERM"
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    assert signal.getsignal(signal.SIGTERM) == before


def _environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
