"""What runs in the guest: plant and controller as processes of their own on vcan0, one controller stopped by SIGTERM,
one killed; between them, at 1 kHz, the Python node and the exported native one.

`python -m tests.hil.bus.socketcan_story FOLDER` needs `rig.toml`, `fast.toml`, `plant.toml` and the exported folder
`native` there, and leaves `story.json` and the logs `run.blf` and `native/run.log`. The processes are forked from one
that has imported everything, which takes minutes in an emulated processor.
"""

from __future__ import annotations

import contextlib
import io
import json
import multiprocessing
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.context import ForkProcess
from pathlib import Path
from typing import Any

import can
import numpy as np

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
FAST_S = 2.0
FAST_TICK_S = 1e-3
AFTERWARDS_S = 0.3
LONGEST_S = 600.0
Heard = list[can.Message]


class Wire:
    """Everything that goes over the bus, as a third party hears it."""

    def __init__(self) -> None:
        self.bus = can.Bus(interface="socketcan", channel=CHANNEL)
        self.heard: Heard = []
        catalogue = load_catalogue()
        known = tuple(catalogue[name] for name in ("CarriageCommand", "CarriageFeedback", "Sync"))
        self.command, self.feedback, self.sync = known
        self._codecs = {frame.id: Codec(frame) for frame in known}

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
        """The signals of a command, feedback or Sync, none of any other frame."""
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


def _lead_natively(folder: Path, log: Path) -> tuple[int, str]:
    """The native node of an exported folder with its status and what it printed."""
    command = [str(folder / "build" / "node"), CHANNEL, f"{FAST_S:g}", str(log)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    return ran.returncode, ran.stdout + ran.stderr


def main(folder: Path) -> None:
    """The whole story."""
    wire, log, rig = Wire(), SCRATCH / "run.blf", str(folder / "rig.toml")
    deployed = DeployedPlant(folder / "plant.toml", BusTable(interface="socketcan", channel=CHANNEL), 20)
    plant = Child(run_plant, deployed, 3600.0)
    found: dict[str, Any] = {"stopped": _stopped(wire, rig, log)}
    found["frames"] = _counts(wire)
    wire.heard.clear()
    found["python"] = _fast(wire, _lead, str(folder / "fast.toml"), "--log", str(SCRATCH / "fast.blf"))
    found["native"] = _fast(wire, _lead_natively, folder / "native", SCRATCH / "run.log")
    shutil.copy(SCRATCH / "run.log", folder / "native")
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


def _fast(wire: Wire, lead: Callable[..., tuple[int, str]], *arguments: Any) -> dict[str, Any]:
    """A controller that leads for `FAST_S` at 1 kHz: what it said, how late its commands were while it led, by the
    kernel's stamps, and how far the carriage went in m.
    """
    wire.heard.clear()
    controller = Child(lead, *arguments)
    while controller.process.is_alive():
        wire.listen(lambda _: False, 0.1)
    status, said = controller.result() or (None, "")
    places = [wire.values(m)["Position_m"] for m in wire.heard if m.arbitration_id == wire.feedback.id]
    moved_m = max(places, default=0.0) - min(places, default=0.0)
    return {"status": status, "said": said, **_lateness(wire), "moved_m": moved_m}


def _lateness(wire: Wire) -> dict[str, Any]:
    """Ticks led, ticks left out, commands sent after the end of their tick, and ms from the begin of a tick, as the
    most punctual Sync has it, to its command.
    """
    number, begun, led = -1, {}, {}
    for message in wire.heard:
        if message.arbitration_id == wire.sync.id:
            number = int(wire.values(message)["Tick"])
            begun[number] = message.timestamp
        elif wire.enabled(message):
            led[number] = message.timestamp
    if not led:
        return {"ticks": 0}
    start_s = min(begun[k] - k * FAST_TICK_S for k in led)
    late_s = np.array([led[k] - start_s - k * FAST_TICK_S for k in led])
    ms = dict(zip(("median", "p99", "most"), (1e3 * np.quantile(late_s, (0.5, 0.99, 1.0))).tolist(), strict=True))
    left_out = max(led) - min(led) + 1 - len(led)
    return {"ticks": len(led), "left_out": left_out, "late": int(np.sum(late_s > FAST_TICK_S)), "sent_ms": ms}


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
    """How often each frame was heard since the controller's first."""
    names = {identifier: frame.name for identifier, frame in load_catalogue().by_id().items()}
    counts: dict[str, int] = {}
    first = next((k for k, message in enumerate(wire.heard) if message.arbitration_id == wire.sync.id), 0)
    for message in wire.heard[first:]:
        name = names.get(message.arbitration_id, "unknown")
        counts[name] = counts.get(name, 0) + 1
    return counts


if __name__ == "__main__":
    main(Path(sys.argv[1]))
