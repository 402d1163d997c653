"""`capsule jog`: what it sends for keys and scripts, what it refuses, and a run that it steers, in three processes."""

import json
import os
import pty
import subprocess
import termios
import time
from pathlib import Path

import pytest

from hil.app.jog import keys, raw_terminal
from hil.app.main import run
from hil.app.scenario.bus_scenario import Step, steps
from hil.bus.catalogue import load_catalogue
from hil.bus.codec import Refusal
from hil.bus.local import LocalBus
from hil.bus.protection import Receiver
from hil.nodes.operator_sender import OperatorSender
from tests.hil.app.run.deployments import deployment, rig_file
from tests.hil.app.run.forked import Forked
from tests.hil.app.run.plant_process import CAPSULE, HELD_UP, TRIES, plant_on, truth_of
from tests.places import ROOT

OPERATOR = "[operator]\naccept = true\nstop_after_s = 0.3\n"


def setpoints(bus: LocalBus) -> list[dict[str, float]]:
    """What came, each accepted by its protection."""
    receiver, found = Receiver(load_catalogue()["OperatorSetpoint"]), []
    while (message := bus.recv(0.05)) is not None:
        if message.arbitration_id == receiver.frame.id:
            values = receiver.accept(message.data, message.timestamp)
            assert not isinstance(values, Refusal)
            found.append(values)
    return found


def test_a_script_is_sent_line_by_line(tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Released at first and at the end; nobody answers: status 1."""
    script = tmp_path / "script.txt"
    script.write_text("speed 3 0.1  # on\nrelease 0.04\n\nposition -2.5 0.1\n")
    file = rig_file(tmp_path, deployment(channel, more=OPERATOR))
    with LocalBus(channel) as bus:
        assert run(["jog", file, "--script", str(script), "--source", "script", "--life", "80", "--json"]) == 1
        found = setpoints(bus)
    told = json.loads(capsys.readouterr().out)
    assert (told["sent"], told["answers"], told["last"]) == (len(found), 0, None)
    assert [s["DeadMan"] for s in found] == [0] * 5 + [1] * 5 + [0] * 2 + [1] * 5 + [0] * 5
    assert [s["Velocity_m_s"] for s in found[5:10]] == pytest.approx([0.003] * 5)
    assert [s["Position_m"] for s in found[12:17]] == pytest.approx([-0.0025] * 5)
    assert {(s["Source"], s["TimeToLive_ms"]) for s in found} == {(5, 80)}


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("sped 3 1", "x line 2: step must be one of speed, position, release; got 'sped'; did you mean 'speed'"),
        ("speed 3", "x line 2: step must be 'speed MM_S SECONDS'; got 'speed 3'"),
        ("speed nan 1", "x line 2: step must be 'speed MM_S SECONDS'"),
        ("release 1 2", "x line 2: step must be 'release SECONDS'"),
        ("position 1 -2", "x line 2: seconds must lie above 0"),
    ],
)
def test_a_line_that_is_no_step(line: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence.replace("(", r"\(")):
        list(steps(["release 1", line], "x"))
    assert list(steps(["  speed -2 0.5"], "x")) == [Step("speed", -0.002, 0.5)]


@pytest.mark.parametrize(
    ("more", "words", "sentence"),
    [
        ("", [], "rig.toml: operator.accept must be true"),
        (OPERATOR, [], "capsule jog must run in a terminal, for its keys; got another input: --script - reads it"),
        (OPERATOR, ["--script", "none.txt"], "none.txt: script must be a text file that can be read"),
        (OPERATOR, ["--script", "-", "--life", "500"], r"life_ms must lie in [1, 200]; got 500"),
        (OPERATOR, ["--script", "-", "--source", "keybord"], "Source must be one of its names; got 'keybord'"),
        (OPERATOR + 'sources = ["ros"]\n', [], "--source must be one of ros; got 'keyboard'"),
        (OPERATOR + 'sources = ["rose"]\n', [], "operator.sources must be among keyboard, cockpit"),
        (OPERATOR + "sources = [1]\n", [], "operator.sources must be text"),
        (OPERATOR + "speed_m_s = 0.35\n", [], "operator.speed_m_s must be at most 0.25, as in [limits]"),
        (OPERATOR + "lowest_m = 0.1\n", [], "operator.lowest_m must lie below highest_m"),
        (OPERATOR + "highest_m = 1.05\n", [], "operator.highest_m must lie within limits.travel_m, 1 m"),
        (OPERATOR + "speed = 1\n", [], "did you mean 'speed_m_s'"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(
    tmp_path: Path,
    channel: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    more: str,
    words: list[str],
    sentence: str,
) -> None:
    with (tmp_path / "empty").open("w+") as empty:
        monkeypatch.setattr("sys.stdin", empty)
        assert run(["jog", rig_file(tmp_path, deployment(channel, more=more)), *words]) == 2
    told = capsys.readouterr().err
    assert sentence in told
    assert told.count("\n") == 1


def test_keys_of_a_terminal_and_the_terminal_as_it_was() -> None:
    leader, follower = pty.openpty()
    before = termios.tcgetattr(follower)
    try:
        with raw_terminal(follower):
            assert not termios.tcgetattr(follower)[3] & (termios.ECHO | termios.ICANON)
            os.write(leader, b"\x1b[C\x1b[Dx\x1b[A \x1bOBq")
            time.sleep(0.05)
            assert keys(follower) == ["right", "left", "up", "release", "down", "quit"]
            assert keys(follower) == []
        assert termios.tcgetattr(follower) == before
    finally:
        os.close(leader)
        os.close(follower)


def test_a_key_moves_while_it_is_held(tmp_path: Path, channel: str) -> None:
    """In a terminal: held for 0.15 s after the last of its repeats, q ends, and the terminal shows keys again."""
    leader, follower = pty.openpty()
    before = termios.tcgetattr(follower)
    command = [*CAPSULE, "jog", rig_file(tmp_path, deployment(channel, more=OPERATOR))]
    with LocalBus(channel) as bus:
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        child = subprocess.Popen(command, stdin=follower, stdout=follower, stderr=follower, env=environment)
        assert bus.recv(60) is not None
        time.sleep(0.5)
        for _ in range(4):
            os.write(leader, b"\x1b[D")
            time.sleep(0.05)
        time.sleep(0.5)
        os.write(leader, b"q")
        assert child.wait(20) == 1
        found = setpoints(bus)
    shown = os.read(leader, 1 << 16)
    assert b"no controller runs: start one with 'capsule run', or with Start in the cockpit" in shown
    assert termios.tcgetattr(follower) == before
    os.close(leader)
    os.close(follower)
    held = [s["Velocity_m_s"] for s in found if s["DeadMan"]]
    assert 8 <= len(held) <= 25
    assert set(held) == {-0.005}
    assert not found[-1]["DeadMan"]


def test_a_run_that_is_steered(tmp_path: Path, channel: str) -> None:
    """Plant, controller and a sender: 2 mm on, held, stopped; the log replays bit by bit."""
    text = deployment(channel, control="duration_s = 4.5\npriority = 20", more=OPERATOR)
    text = text.replace('kind = "ramp"\nspeed_mm_s = 2.0', 'kind = "hold"')
    file, log = rig_file(tmp_path, text), tmp_path / "run.blf"
    for _ in range(TRIES):
        with plant_on(tmp_path, channel) as plant, LocalBus(channel) as bus:
            child = Forked(tmp_path, "run", file, "--log", str(log), "--json")
            hand = OperatorSender(bus, "script")
            until = time.monotonic() + 60
            while time.monotonic() < until and (hand.answer is None or hand.answer.state != "ready"):
                hand.release()
                hand.listen()
                time.sleep(0.02)
            states, began = {"ready"}, time.monotonic()
            for cycle in range(150):
                hand.speed(0.004) if 50 <= cycle < 75 else hand.release()
                answer = hand.listen()
                states |= {answer.state} if answer else set()
                time.sleep(0.02)
            late = time.monotonic() - began > 4.0
            status, said, _ = child.ended()
            found, truth = json.loads(said), truth_of(plant)
        if found["ended"] not in HELD_UP and not late and not found["operator"]["expired"]:
            break
    assert (found["ended"], found["led"], status) == ("done", True, 0)
    assert states >= {"ready", "moving", "held", "stopped"}
    assert found["operator"]["presses"] >= 1
    assert truth["moved_m"] == pytest.approx(2e-3, abs=1.5e-3)
    assert truth["fault"] == 0
    assert run(["replay", str(log)]) == 0
