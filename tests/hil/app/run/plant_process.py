"""A plant in a process of its own, for what leads it in real time."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hil.nodes.drive.state_machine import HEARTBEAT_LOST, TIME_TO_LIVE
from tests.hil.app.run.deployments import PLANT, deployment

CAPSULE = (sys.executable, "-m", "hil.app.start")
RUN_S = 1.5
REAL_TIME = f"duration_s = {RUN_S}\npriority = 20"
"""With SCHED_FIFO where the system allows it: these tests run beside others."""

TRIES = 50
"""A machine that holds a process up for longer than a command lives ends a run; that is right, and the run is done
again.
"""

HELD_UP = (
    "controller paused",
    "clock jumped",
    "feedback lost",
    "drive heartbeat lost",
    f"drive fault {TIME_TO_LIVE}",
    f"drive fault {HEARTBEAT_LOST}",
    "drive left operation",
    "localisation lost",
    "drive not enabled",
)
"""How a run may end on such a machine."""


@contextmanager
def plant_on(folder: Path, channel: str, drive: str = "", bus: str = "") -> Iterator[subprocess.Popen[str]]:
    """A plant with its drive, ready, for the time of the block."""
    (folder / "plant.toml").write_text(PLANT)
    deployed = folder / "deployed.toml"
    plant = f'[plant]\nscenario = "plant.toml"\npriority = 20\n{drive}'
    deployed.write_text(deployment(channel, more=plant, bus=bus))
    command = [*CAPSULE, "plant", str(deployed), "--seconds", "60", "--json"]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert child.stderr is not None
        assert child.stderr.readline() == "ready\n"
        yield child
    finally:
        if child.returncode is None:
            child.kill()
            child.communicate()


def truth_of(plant: subprocess.Popen[str]) -> dict[str, Any]:
    """End it; what it says of itself then."""
    plant.terminate()
    return dict(json.loads(plant.communicate()[0]))
