"""What runs in the guest: plant and controller as processes of their own on vcan0, one controller stopped by SIGTERM,
one killed.

`python -m tests.hil.bus.socketcan_story FOLDER` needs `rig.toml` and `plant.toml` there and leaves `story.json` and the
log `run.blf`. The processes are forked from one that has imported everything, which takes minutes in an emulated
processor.
"""

from __future__ import annotations

import contextlib
import io
import json
import multiprocessing
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.context import ForkProcess
from pathlib import Path
from typing import Any

import can

from hil.app.main import run
from hil.app.run import run as _imported  # noqa: F401 - before the fork
from hil.app.run.simulated_plant import run_plant
from hil.app.scenario.deployment import DeployedPlant
from hil.app.scenario.deployment_tables import BusTable
from hil.bus.catalogue import load_catalogue
from hil.bus.codec import Codec
from hil.nodes.frame_map import ENABLE, MOVING, STOPPING

SCRATCH = Path(tempfile.gettempdir())
CHANNEL = "vcan0"
LEADS_S = 0.6
AFTERWARDS_S = 0.3
LONGEST_S = 600.0
Heard = list[can.Message]


class Wire:
    """Everything that goes over the bus, as a third party hears it."""

    def __init__(self) -> None:
        self.bus = can.Bus(interface="socketcan", channel=CHANNEL)
        self.heard: Heard = []
        catalogue = load_catalogue()
        self.command, self.feedback = catalogue["CarriageCommand"], catalogue["CarriageFeedback"]
        self._codecs = {frame.id: Codec(frame) for frame in (self.command, self.feedback)}

    def listen(self, until: Callable[[can.Message], bool], longest_s: float = LONGEST_S) -> bool:
        """Take frames in until one is as wanted; whether it came."""
        began = time.monotonic()
        while time.monotonic() - began < longest_s:
            message = self.bus.recv(0.1)
            if message is not None:
                self.heard.append(message)
                if until(message):
                    return True
        return False

    def values(self, message: can.Message) -> dict[str, float]:
        """The signals of a command or feedback, none of any other frame."""
        codec = self._codecs.get(message.arbitration_id)
        found = codec.decode(int.from_bytes(message.data, "little")) if codec else {}
        return found if isinstance(found, dict) else {}

    def enabled(self, message: can.Message) -> bool:
        """Whether it commands the drive to move."""
        return message.arbitration_id == self.command.id and self.values(message).get("Mode") == ENABLE

    def lead(self, controller: Child) -> bool:
        """Until a controller has led for `LEADS_S`; whether it came to that."""
        began = time.monotonic()
        while time.monotonic() - began < LONGEST_S and controller.process.is_alive():
            if self.listen(self.enabled, 1.0):
                self.listen(lambda _: False, LEADS_S)
                return controller.process.is_alive()
        return False


class Child:
    """A process that runs a function and hands over what it gives."""

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        context = multiprocessing.get_context("fork")
        self._here, there = context.Pipe()
        self.process: ForkProcess = context.Process(target=_handing_over, args=(there, function, arguments))
        self.process.start()
        there.close()

    def result(self) -> Any:
        """What the function gave; None where it was killed."""
        try:
            return self._here.recv()
        except EOFError:
            return None
        finally:
            self.process.join()


def _handing_over(end: Connection, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    end.send(function(*arguments))


def _lead(*arguments: str) -> tuple[int, str]:
    """`capsule run` with its status and what it printed."""
    with contextlib.redirect_stdout(io.StringIO()) as said:
        status = run(["run", *arguments, "--json"])
    return status, said.getvalue()


def main(folder: Path) -> None:
    """The whole story."""
    wire, log, rig = Wire(), SCRATCH / "run.blf", str(folder / "rig.toml")
    deployed = DeployedPlant(folder / "plant.toml", BusTable(interface="socketcan", channel=CHANNEL), 20)
    plant = Child(run_plant, deployed, 3600.0)
    found: dict[str, Any] = {"stopped": _stopped(wire, rig, log)}
    found["frames"] = _counts(wire)
    wire.heard.clear()
    found["killed"] = _killed(wire, rig)
    plant.process.terminate()
    found["plant"] = plant.result()
    wire.bus.shutdown()
    found["replayed"] = Child(run, ["replay", str(log)]).result()
    (folder / "story.json").write_text(json.dumps(found))
    for path in log.parent.glob("run.blf*"):
        shutil.copy(path, folder)


def _stopped(wire: Wire, rig: str, log: Path) -> dict[str, Any]:
    """A controller that leads and is then asked to stop: its own summary, and what the drive last said."""
    controller = Child(_lead, rig, "--log", str(log))
    led = wire.lead(controller)
    controller.process.terminate()
    while controller.process.is_alive():
        wire.listen(lambda _: False, 0.1)
    status, said = controller.result() or (None, "{}")
    last = next((m for m in reversed(wire.heard) if m.arbitration_id == wire.feedback.id), None)
    state = None if last is None else wire.values(last)["State"]
    return {"led": led, "summary": json.loads(said or "{}"), "status": status, "state": state}


def _killed(wire: Wire, rig: str) -> dict[str, Any]:
    """A controller that is killed while it leads: times in ms from its last command to the drive's first word that it
    does not follow any more, and to its first word that it is at rest, by the kernel's stamps.
    """
    controller = Child(_lead, rig, "--log", str(SCRATCH / "killed.blf"))
    led = wire.lead(controller)
    controller.process.kill()
    wire.listen(lambda _: False, AFTERWARDS_S)
    controller.result()
    last = max((m.timestamp for m in wire.heard if m.arbitration_id == wire.command.id), default=0.0)
    after = [(m.timestamp - last, wire.values(m)) for m in wire.heard if m.arbitration_id == wire.feedback.id]
    after = [(t, v) for t, v in after if t > 0]
    left = next((t for t, v in after if v["State"] not in (*MOVING, STOPPING)), None)
    rest = next((t for t, v in after if v["State"] not in MOVING and v["Velocity_m_s"] == 0.0), None)
    moved = [v["Position_m"] for t, v in after if rest is not None and t >= rest]
    return {
        "led": led,
        "left_ms": None if left is None else 1e3 * left,
        "rest_ms": None if rest is None else 1e3 * rest,
        "creep_m": max(moved) - min(moved) if moved else None,
    }


def _counts(wire: Wire) -> dict[str, int]:
    """How often each frame was heard."""
    names = {identifier: frame.name for identifier, frame in load_catalogue().by_id().items()}
    counts: dict[str, int] = {}
    for message in wire.heard:
        name = names.get(message.arbitration_id, "unknown")
        counts[name] = counts.get(name, 0) + 1
    return counts


if __name__ == "__main__":
    main(Path(sys.argv[1]))
