"""`capsule sil` with an operator of `[jog]`, and over an authenticated bus: what it tells, that its log replays, and
what it refuses.
"""

import json
from pathlib import Path
from typing import Any

import pytest

from hil.app.main import run as capsule

SCENARIO = """
[scenario]
name = "by hand"
duration_s = 1.2
[rig]
kind = "magnetic"
[reference]
kind = "hold"
start_s = 0.1
[control]
judged_from_s = 0.2
[operator]
accept = true
stop_after_s = 0.2
[jog]
source = "joystick"
script = ["release 0.1", "speed 4 0.5  # 2 mm", "release 1"]
"""
KEYED = """
[bus]
fd = true
key_file = "bus.key"
"""


def written(folder: Path, text: str = SCENARIO, key: str = bytes(range(16)).hex()) -> Path:
    path = folder / "hand.toml"
    path.write_text(text, encoding="utf-8")
    file = folder / "bus.key"
    file.touch(0o600)
    file.write_text(key, encoding="utf-8")
    return path


def told(path: Path, capsys: pytest.CaptureFixture[str], *more: str) -> dict[str, Any]:
    assert capsule(["sil", str(path), "--json", *more]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_steered_held_and_stopped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Once in charge, two seconds' worth of setpoints taken, none refused; the log replays bit by bit."""
    found = told(written(tmp_path), capsys, "--out", str(tmp_path / "out"))
    assert found["operator"] == {"presses": 1, "expired": 0, "accepted": 60, "limited": 0, "refused": {}}
    assert found["hard_violations"] == 0
    assert found["tracking_max_m"] < 1e-3, "of what the operator wanted, not of the file's rest"
    assert "unauthenticated" not in found["bus"]
    assert capsule(["replay", found["log"], "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["identical"]


def test_over_an_authenticated_bus(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same run; frames that were tampered with are told, and the log, which holds no key, replays without one."""
    fault = '[[faults]]\nkind = "forged"\ntarget = "localisation"\nat_s = 0.4\nduration_s = 0.03\n'
    path = written(tmp_path, SCENARIO + KEYED + fault)
    found = told(path, capsys, "--out", str(tmp_path / "out"))
    assert found["operator"]["accepted"] == 60
    assert found["bus"]["unauthenticated"] == {"forged": 3}
    assert found["faults"][0]["unsafe"] is False
    assert not list(tmp_path.glob("*.epoch")), "a simulated start is not counted"
    (tmp_path / "bus.key").unlink()
    assert capsule(["replay", found["log"], "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["identical"]


def test_the_summary_tells_of_both(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fault = '[[faults]]\nkind = "unkeyed"\ntarget = "commands"\nat_s = 0.4\n'
    assert capsule(["sil", str(written(tmp_path, SCENARIO + KEYED + fault))]) == 1
    out = capsys.readouterr().out
    assert "operator: 1 press, 0 late, 60 setpoints taken" in out
    assert "not authentic: 100 classic" in out
    assert "fault at 0.4 s (unkeyed commands): safe after" in out


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("accept = true", "accept = false"), "operator.accept must be true with [jog]"),
        (('"release 1"', '"relase 1"'), "jog.script line 3: step must be one of speed, position, release"),
        (('"joystick"', '"joystik"'), "jog.source must be one of"),
        (("[jog]", "[jog]\nlife_ms = 201"), "jog.life_ms must lie in [1, 200]; got 201"),
        (("accept = true", "accept = true\nspeed_m_s = 0.4"), "operator.speed_m_s must be at most"),
        (("fd = true", "fd = false"), "bus.fd must be true with bus.key_file"),
        (("fd = true", "fd = true\ndata_bitrate = 9000000"), "bus.data_bitrate must lie in [1e+06, 8e+06]"),
        (('"bus.key"', '"none.key"'), "bus.key_file must be a file that can be read"),
        (('"bus.key"', '"hand.toml"'), "bus.key_file must be its owner's alone"),
        (("[jog]", "[moteus]\n[jog]"), "bus.key_file must be left out with another maker's drive"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], change: tuple[str, str], sentence: str
) -> None:
    path = written(tmp_path, (SCENARIO + KEYED).replace(*change, 1))
    path.chmod(0o644)
    assert capsule(["sil", str(path)]) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1


def test_a_loop_without_a_bus_has_no_operator(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert capsule(["track", str(written(tmp_path))]) == 2
    assert "which `capsule sil` reads" in capsys.readouterr().err
