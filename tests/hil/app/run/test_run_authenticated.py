"""`capsule run` and `capsule plant` on an authenticated bus: they lead as ever, and what others send does nothing."""

import json
import time
from pathlib import Path
from typing import Any

import can
import pytest

from hil.app.main import run
from hil.bus.authenticated import LENGTH
from hil.bus.catalogue import load_catalogue
from hil.bus.local import LocalBus
from tests.hil.app.run.deployments import PLANT, deployment
from tests.hil.app.run.forked import Forked
from tests.hil.app.run.plant_process import HELD_UP, TRIES, truth_of

KEY = bytes(range(16)).hex()


def files(folder: Path, channel: str, seconds: float = 1.0, more: str = "") -> str:
    """A deployment with its key and plant; its path."""
    (folder / "plant.toml").write_text(PLANT)
    key = folder / "bus.key"
    key.write_text(KEY)
    key.chmod(0o600)
    text = deployment(channel, control=f"duration_s = {seconds}\npriority = 20")
    text = text.replace("[control]", f'fd = true\nkey_file = "bus.key"\n{more}[control]')
    path = folder / "rig.toml"
    path.write_text(f'{text}\n[plant]\nscenario = "plant.toml"\npriority = 20\n')
    return str(path)


class Attacker:
    """Records what is said on the bus, says it again, and what it makes of it without the key."""

    def __init__(self, channel: str) -> None:
        self.bus = LocalBus(channel, fd=True)
        self.heard: list[can.Message] = []

    def listen(self) -> None:
        while (message := self.bus.recv(0.001)) is not None:
            self.heard.append(message)

    def say(self, message: can.Message, data: bytes, fd: bool = True) -> None:
        self.bus.send(
            can.Message(
                arbitration_id=message.arbitration_id,
                is_extended_id=False,
                is_fd=fd,
                bitrate_switch=fd,
                data=data,
            )
        )

    def attack(self) -> int:
        """Every tenth frame of those of late again, as it was, as a classic one, and with a count that goes on."""
        chosen = self.heard[-500::10]
        for message in chosen:
            data = bytes(message.data)
            self.say(message, data)
            self.say(message, data[:8], fd=False)
            self.say(message, data[:8] + (int.from_bytes(data[8:12], "little") + 999).to_bytes(4, "little") + data[12:])
        return len(chosen)


def attacked_run(folder: Path, channel: str) -> tuple[dict[str, Any], dict[str, Any], Attacker]:
    """What controller and plant say of a run with an attacker beside it."""
    file, attacker = files(folder, channel), Attacker(channel)
    plant = Forked(folder, "plant", file, "--json")
    plant.until_ready()
    child = Forked(folder, "run", file, "--log", str(folder / "run.blf"), "--json")
    while child.process.is_alive():
        attacker.listen()
        attacker.attack()
        time.sleep(0.05)
    return json.loads(child.ended()[1]), truth_of(plant), attacker


@pytest.mark.slow
def test_an_attacker_without_the_key_does_nothing(tmp_path: Path, channel: str) -> None:
    """Beside a run, and with its recording to a plant that has booted anew; the log replays bit by bit."""
    for _ in range(TRIES):
        found, truth, attacker = attacked_run(tmp_path, channel)
        if found["ended"] not in HELD_UP:
            break
    assert (found["end"], found["other_controller"]) == ("done", {})
    assert set(found["unauthenticated"]) == {"replayed", "forged", "classic"}
    assert set(truth["unauthenticated"]) == {"replayed", "forged", "classic"}
    assert all(count > 100 for count in truth["unauthenticated"].values())
    assert (truth["fault"], truth["state"]) == (0, 2)
    assert truth["moved_m"] == pytest.approx(2e-3, abs=1.5e-3)
    assert run(["replay", str(tmp_path / "run.blf")]) == 0

    own = {frame.id for frame in load_catalogue().frames.values() if frame.sender == "Controller"}
    recorded = [message for message in attacker.heard if message.arbitration_id in own and len(message.data) == LENGTH]
    plant = Forked(tmp_path, "plant", files(tmp_path, channel), "--json")
    plant.until_ready()
    attacker.bus.recv(0.01)
    began, first = time.monotonic(), recorded[0].timestamp
    for message in recorded:
        time.sleep(max(began + message.timestamp - first - time.monotonic(), 0.0))
        attacker.say(message, bytes(message.data))
    truth = truth_of(plant)
    assert set(truth["slots_in_state"]) <= {"0", "1", "2"}, "boot, self-test, standby"
    assert truth["moved_m"] == pytest.approx(0.0, abs=1e-6)
    attacker.bus.shutdown()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("fd = true\n", ""), "rig.toml: bus.fd must be true with bus.key_file"),
        (('"bus.key"', '"none.key"'), "bus.key_file must be a file that can be read"),
        (('"bus.key"', '"rig.toml"'), "bus.key_file must be its owner's alone"),
        (("[control]", "data_bitrate = 9000000\n[control]"), "bus.data_bitrate must lie in [1e+06, 8e+06]"),
        (("[control]", "data_bitrate = 3000000\n[control]"), "bus.data_bitrate must be one that 80 MHz can make"),
        (("[control]", "[cia402]\nnode_id = 1\n[control]"), "bus.key_file must be left out with another maker's drive"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(
    tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str], change: tuple[str, str], sentence: str
) -> None:
    file = Path(files(tmp_path, channel))
    file.write_text(file.read_text().replace(*change, 1))
    file.chmod(0o644)
    assert run(["run", str(file), "check"]) == 2
    told = capsys.readouterr().err
    assert sentence in told
    assert told.count("\n") == 1
