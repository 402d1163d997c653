"""What `capsule jog` says where its setpoints are refused: counted by reason, told, status 1."""

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest

from controller.reference import rest
from hil.app.main import run
from hil.bus.catalogue import load_catalogue
from hil.bus.local import LocalBus
from hil.bus.protection import Sender
from hil.nodes.operator import SETPOINT, STATUS, Operator, OperatorLimits
from hil.nodes.operator_sender import OperatorSender
from tests.hil.app.run.deployments import deployment, rig_file

MORE = "[operator]\naccept = true\n"
TRIES = 20
HELD_UP = {"late", "not_released"}
"""What becomes of setpoints on a machine that holds one of both up; it is done again."""
Hand = Callable[[OperatorSender], None]


@contextmanager
def answered(channel: str, source: str = "joystick", hand: Hand | None = None) -> Iterator[None]:
    """A controller's part of steering on the bus, 50 times a second, and somebody else who steers, where there is a
    `hand`.
    """
    over, catalogue, begun = threading.Event(), load_catalogue(), threading.Event()

    def work() -> None:
        operator, says = Operator(OperatorLimits(accept=True)), Sender(catalogue[STATUS])
        reference = rest(0.0)
        with LocalBus(channel) as bus, LocalBus(channel) as beside:
            other = OperatorSender(beside, source)
            for k in range(1 << 30):
                if hand is not None:
                    other.release() if k < 10 else hand(other)
                while (message := bus.recv(0)) is not None:
                    if message.arbitration_id == catalogue[SETPOINT].id:
                        operator.accept(message.data, message.timestamp, time.time())
                operator.expire(time.time())
                reference = operator.follow(time.time(), reference, 0.0)  # type: ignore[assignment]
                data = says.frame(operator.status(time.time(), reference, True))
                bus.send(can.Message(arbitration_id=catalogue[STATUS].id, is_extended_id=False, data=data))
                if k == 20:
                    begun.set()
                if over.wait(0.02):
                    return

    thread = threading.Thread(target=work)
    thread.start()
    assert begun.wait(60)
    try:
        yield
    finally:
        over.set()
        thread.join()


def jogged(folder: Path, channel: str, *words: str) -> tuple[str, str]:
    """The deployment and a script that presses fifty times."""
    script = folder / "script.txt"
    script.write_text("release 0.1\nspeed 2 1.0\n")
    return rig_file(folder, deployment(channel, more=MORE)), str(script)


def test_another_one_steers(tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]) -> None:
    """50 of 50 presses are refused as busy: said, counted, status 1; the other one steers on."""
    file, script = jogged(tmp_path, channel)
    with answered(channel, hand=lambda hand: hand.speed(0.002)):
        assert run(["jog", file, "--script", script, "--source", "script", "--json"]) == 1
        found = json.loads(capsys.readouterr().out)
        assert run(["jog", file, "--script", script, "--source", "script"]) == 1
    assert (found["taken"], found["refused"], found["others"]) == (0, {"busy": 50}, 0)
    assert found["last"]["source"] == "joystick"
    told = " ".join(capsys.readouterr().out.split())
    assert "50 of 50 setpoints with the switch held were refused" in told
    assert "50 times: joystick steers: release, wait until joystick has let go, press again" in told


def test_nobody_else_steers(tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]) -> None:
    file, script = jogged(tmp_path, channel)
    for _ in range(TRIES):
        with answered(channel):
            status = run(["jog", file, "--script", script, "--source", "script", "--json"])
        found = json.loads(capsys.readouterr().out)
        if not found["refused"].keys() & HELD_UP:
            break
    assert (status, found["taken"], found["refused"]) == (0, 50, {})


@pytest.mark.parametrize("pressed", [True, False])
def test_another_one_sends_by_the_same_name(
    tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str], pressed: bool
) -> None:
    """Nothing is sent, so the first one's charge does not end."""
    file, script = jogged(tmp_path, channel)
    hand: Hand = (lambda hand: hand.speed(0.002)) if pressed else (lambda hand: hand.release())
    steers = "script" if pressed else "nobody"
    for _ in range(TRIES):
        with answered(channel, "script", hand), LocalBus(channel) as beside:
            witness = OperatorSender(beside, "ros")
            assert run(["jog", file, "--script", script, "--source", "script", "--json"]) == 1
            found = json.loads(capsys.readouterr().out)
            assert run(["jog", file, "--script", script, "--source", "script"]) == 1
            told = " ".join(capsys.readouterr().out.split())
            answer = witness.listen()
        assert answer is not None
        if answer.source == steers or answer.refused not in HELD_UP:
            break
    assert found["sent"] == 0
    assert found["others"] >= 1
    assert "another sender is on the bus as script: choose another name by --source" in told
    assert answer.source == steers
