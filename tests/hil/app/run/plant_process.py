"""A plant in a process of its own and `capsule run` in another, which leads it in real time."""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hil.nodes.frame_map import HEARTBEAT_LOST, TIME_TO_LIVE
from tests.hil.app.run.deployments import PLANT, deployment
from tests.hil.app.run.forked import Forked

CAPSULE = (sys.executable, "-m", "hil.app.start")
RUN_S = 1.5
REAL_TIME = f"duration_s = {RUN_S}\npriority = 20"
"""With SCHED_FIFO where the system allows it: these tests run beside others."""

TRIES = 50
"""A machine that holds a process up for longer than a command lives ends a run; that is right, and the run is done
again.
"""

_HELD_UP = (
    "controller paused",
    "controller late",
    "feedback lost",
    "drive heartbeat lost",
    f"drive fault {TIME_TO_LIVE}",
    f"drive fault {HEARTBEAT_LOST}",
    "drive left operation",
    "localisation lost",
    "drive not enabled",
)


class HeldUp:
    """How a run may end on such a machine: by one of these reasons, and what is told behind it."""

    def __contains__(self, ended: object) -> bool:
        return str(ended).startswith(_HELD_UP)


HELD_UP = HeldUp()


@contextmanager
def plant_on(folder: Path, channel: str, drive: str = "", bus: str = "") -> Iterator[Forked]:
    """A plant with its drive, ready, for the time of the block."""
    (folder / "plant.toml").write_text(PLANT)
    deployed = folder / "deployed.toml"
    plant = f'[plant]\nscenario = "plant.toml"\npriority = 20\n{drive}'
    deployed.write_text(deployment(channel, more=plant, bus=bus))
    child = Forked(folder, "plant", str(deployed), "--seconds", "60", "--json")
    try:
        child.until_ready()
        yield child
    finally:
        child.kill()


def truth_of(plant: Forked) -> dict[str, Any]:
    """End it; what it says of itself then."""
    plant.terminate()
    return dict(json.loads(plant.ended()[1]))


def led(
    folder: Path, channel: str, rig: str, log: Path, drive: str = "", bus: str = ""
) -> tuple[dict[str, Any], dict[str, Any], int]:
    """What controller and plant say of a run of `rig` in real time, of the first that was not held up, and its
    status.
    """
    for _ in range(TRIES):
        with plant_on(folder, channel, drive, bus) as plant:
            status, said, complained = Forked(folder, "run", rig, "--log", str(log), "--json").ended()
            truth = truth_of(plant)
        assert said, complained
        found = json.loads(said)
        if found["ended"] == "done":
            break
    return found, truth, status
