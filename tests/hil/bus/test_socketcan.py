"""SocketCAN for real, in a Debian kernel with vcan under QEMU: opt-in, `CAPSULE_QEMU=1 python -m pytest
tests/hil/bus/test_socketcan.py`.

Five to ten minutes without KVM. The kernel is kept in `CAPSULE_QEMU_FOLDER` where that is set.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from hil.app.main import run
from hil.app.run.check import rehearse
from hil.app.scenario.deployment import load_deployment
from hil.app.scenario.scenario import load_track_scenario
from hil.bus.catalogue import load_catalogue
from hil.log.blf_file import RECEIVED, SENT
from hil.log.reader import read_frames
from hil.nodes.frame_map import FAULT, STANDBY
from plant.session import Session
from tests.hil.app.export.tools import done, tool
from tests.hil.app.run.deployments import PLANT, deployment
from tests.hil.bus.guest import NoGuestError, covered, prepare, run_in
from tests.hil.bus.socketcan_story import FAST_S, FAST_TICK_S
from tests.places import ROOT

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        os.environ.get("CAPSULE_QEMU") != "1", reason="boots a kernel in QEMU for minutes: set CAPSULE_QEMU=1"
    ),
]
LONGEST_S = 3600.0
TICK_MS = 2.0
TIME_TO_LIVE = 4


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that guest and host share, with the files of a rig on vcan0 and of the plant that stands in for it."""
    folder = tmp_path_factory.mktemp("guest")
    (folder / "plant.toml").write_text(PLANT)
    (folder / "rig.toml").write_text(deployment("vcan0", "socketcan", control="duration_s = 60.0\npriority = 20"))
    fast = f"duration_s = {FAST_S:g}\ntick_s = {FAST_TICK_S:g}\npriority = 20\nprobe = false"
    (folder / "fast.toml").write_text(deployment("vcan0", "socketcan", control=fast))
    return folder


@pytest.fixture(scope="module")
def environment(work: Path) -> dict[str, str]:
    """Code is generated on the host, for a processor without extensions, and found ready by the guest."""
    found = {
        "CAPSULE_CACHE": str(work / "cache"),
        "NUMBA_CACHE_DIR": str(work / "numba"),
        "NUMBA_CPU_NAME": "generic",
        "NUMBA_CPU_FEATURES": "",
        "OPENBLAS_NUM_THREADS": "1",
        "HOME": "/tmp",
        "PATH": os.environ["PATH"],
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    return found


@pytest.fixture(scope="module")
def story(work: Path, environment: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What happened in the guest."""
    if hidden := covered([ROOT, Path(sys.executable), Path(sys.prefix)]):
        pytest.fail(hidden)
    kept = os.environ.get("CAPSULE_QEMU_FOLDER")
    try:
        guest = prepare(Path(kept) if kept else tmp_path_factory.mktemp("kernel"))
    except NoGuestError as error:
        pytest.skip(str(error))
    warm = [sys.executable, "-m", "tests.hil.bus.test_socketcan", str(work)]
    subprocess.run(warm, check=True, env=environment)
    said = run_in(
        guest, work, [sys.executable, "-m", "tests.hil.bus.socketcan_story", str(work)], environment, LONGEST_S
    )
    assert (work / "story.json").is_file(), said[-4000:]
    found: dict[str, Any] = json.loads((work / "story.json").read_text())
    print(json.dumps(found, indent=1))
    return found


def test_frames_pass_both_ways(story: dict[str, Any]) -> None:
    """All frames of a magnetic rig are on the kernel's bus, none of the others, at their rates."""
    frames, ticks = story["frames"], story["stopped"]["summary"]["ticks"]
    asked = {"Sync", "CarriageCommand", "ControllerHeartbeat", "EnableAnswer"}
    answered = {
        "CarriageFeedback",
        "CarriageHeartbeat",
        "CarriageChallenge",
        "CapsuleLocalisation",
        "LocaliserHeartbeat",
    }
    shown = {"ModelHealth", "BelievedMotion", "WantedMotion", "BelievedForces"}
    assert set(frames) == asked | answered | shown
    assert frames["Sync"] == frames["CarriageCommand"] == ticks
    assert frames["CarriageFeedback"] >= 0.9 * ticks
    summary = story["stopped"]["summary"]
    assert summary["refused"] == summary["unsent"] == summary["log_dropped"] == 0


def test_a_signal_leads_to_a_controlled_stop(story: dict[str, Any]) -> None:
    stopped = story["stopped"]
    assert stopped["led"]
    assert stopped["summary"]["ended"] == "controlled stop (SIGTERM)"
    assert (stopped["status"], stopped["state"]) == (0, STANDBY)


def test_a_killed_controller_leaves_a_carriage_at_rest(story: dict[str, Any]) -> None:
    """The kernel sends nothing for a dead process: time to live, braking, a latched fault; the limit is 25 ms for the
    carriage and the feedback that tells of it comes once a tick.
    """
    killed = story["killed"]
    assert killed["led"]
    assert killed["left_ms"] <= 25.0 + TICK_MS
    assert killed["rest_ms"] <= 25.0 + TICK_MS
    assert killed["creep_m"] == 0.0
    assert (story["plant"]["state"], story["plant"]["fault"]) == (FAULT, TIME_TO_LIVE)


def test_the_log_has_what_was_on_the_wire(story: dict[str, Any], work: Path) -> None:
    """What was sent, what was received, and enough of both for the same commands to come out of it again, bit by
    bit.
    """
    names = {identifier: frame.name for identifier, frame in load_catalogue().by_id().items()}
    frames = [(names[f.id], f.direction) for f in read_frames(work / "run.blf") if f.direction in (RECEIVED, SENT)]
    for name in ("Sync", "CarriageCommand", "ControllerHeartbeat"):
        assert frames.count((name, SENT)) == story["frames"][name]
        assert frames.count((name, RECEIVED)) == 0
    for name in ("CarriageFeedback", "CarriageHeartbeat", "CapsuleLocalisation"):
        assert 0.5 * story["frames"][name] <= frames.count((name, RECEIVED)) <= story["frames"][name]
    assert story["replayed"] == 0


def test_the_native_node_leads_at_1_kHz(story: dict[str, Any], work: Path) -> None:
    """Beside the Python loop in the same guest: both lead to the end; the native one's log replays bit by bit here."""
    for who in ("python", "native"):
        found = story[who]
        assert found["status"] == 0, found
        assert found["ticks"] > 0.9 * FAST_S / FAST_TICK_S
        assert found["moved_m"] > 2e-3
    assert "ended: done" in story["native"]["said"]
    assert "unsent 0, missing in the log 0" in story["native"]["said"]
    assert story["native"]["late"] <= story["python"]["late"]
    assert story["native"]["left_out"] <= story["python"]["left_out"]
    assert run(["replay", str(work / "native" / "run.log")]) == 0


def warm(folder: Path) -> None:
    """Generate and compile here what the guest would take minutes for."""
    scenario = load_track_scenario(folder / "plant.toml")
    Session(scenario.truth, scenario.instruments, scenario.seed, 0.0).advance(0.0, 1e-3)
    for name in ("rig", "fast"):
        rehearse(load_deployment(folder / f"{name}.toml").task(), 20)
    native = folder / "native"
    assert run(["export", "controller", str(folder / "fast.toml"), "--out", str(native)]) == 0
    done([tool("make"), "node"], native)


if __name__ == "__main__":
    warm(Path(sys.argv[1]))
