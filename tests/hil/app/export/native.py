"""The exported native node in this process, before the simulated plant."""

import ctypes
import random
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from hil.app.scenario.bus_scenario import SilScenario
from hil.bus.wrapping import classic_frame, waiting
from hil.nodes.frame_map import frames
from hil.simulated.medium import Medium, SimulatedBus
from hil.simulated.plant_node import SLOT_S, PlantNode
from plant import layout as at
from plant.session import Session
from tests.hil.app.export.tools import compiled, tool

PHASE_S = 0.2e-3  # of the drive's firmware after the begin of a tick, as in `capsule sil`
LISTENS_S = 0.3  # before the start
HERE = Path(__file__)


class Frame(ctypes.Structure):
    """`frame`"""

    _fields_ = (("id", ctypes.c_uint32), ("data", ctypes.c_uint8 * 8))


@dataclass
class Led:
    """How a run ended; tracking error in m (rms) behind the reference once led; frames of the drive's last state."""

    reason: str
    led: bool
    tracking_rmse_m: float
    rejected: int
    state: int


def native(folder: Path) -> ctypes.CDLL:
    """The node of an exported folder as a library."""
    flags = next(line for line in (folder / "Makefile").read_text().splitlines() if line.startswith("FLAGS"))
    own = [
        *folder.glob("*.c"),
        *(folder / "node" / f"{name}.c" for name in ("node", "guard", "protection", "frames", "log")),
    ]
    daqp = sorted((folder / "daqp" / "src").glob("*.c"))
    sources = [*own, *daqp, HERE.with_name("native_loop.c")]
    options = ["-O2", "-w", "-std=gnu99", *flags.partition(":=")[2].split()]
    found = compiled(
        tool("cc"), folder / "native.so", sources, folder, folder / "node", folder / "daqp/include", more=options
    )
    found.reason.restype = found.doubt.restype = ctypes.c_char_p
    found.reference_m.restype = found.reference_s.restype = ctypes.c_double
    found.doubt.argtypes = found.start.argtypes = found.end_log.argtypes = [ctypes.c_double]
    found.hear.argtypes = [ctypes.c_uint32, ctypes.c_char_p, ctypes.c_int, ctypes.c_double]
    found.speak.argtypes = found.tick.argtypes = [ctypes.c_double, ctypes.c_void_p]
    return found


def led(
    node: ctypes.CDLL, scenario: SilScenario, seconds: float, cut_s: float = np.inf, log: Path | None = None
) -> Led:
    """Run the native node before the scenario's plant, with its `log`; from `cut_s` on it receives nothing."""
    loop = scenario.loop
    medium = Medium(frames().bit_rate)
    ports = {name: SimulatedBus(medium, name) for name in ("controller", "drive", "localiser")}
    session = Session(loop.truth, loop.instruments, loop.seed, 0.0)
    tick_s, room = loop.control.tick_s, (Frame * 6)()
    draw = partial(random.Random(loop.seed).getrandbits, 32)
    plant = PlantNode(session, loop.limits, tick_s, ports["drive"], ports["localiser"], drive=None, draw=draw)
    slots, rows = round(tick_s / SLOT_S), []
    node.begin()
    assert log is None or node.log_to(str(log).encode())

    def say(count: int) -> None:
        for k in range(count):
            ports["controller"].send(classic_frame(room[k].id, bytes(room[k].data)))

    for k in range(round(seconds / tick_s)):
        now = round(k * tick_s, 9)
        if k == round(LISTENS_S / tick_s):
            assert node.doubt(now) == b""
            node.start(now)
        say(node.speak(now, room))
        for message in waiting(ports["controller"], 256):
            if now < cut_s:
                node.hear(message.arbitration_id, bytes(message.data), len(message.data), round(message.timestamp, 9))
        say(node.tick(now, room))
        for number in range(slots):
            medium.advance(now + PHASE_S + number * SLOT_S)
            plant.tick(now + PHASE_S + number * SLOT_S)
        medium.advance(now + tick_s)
        if node.leads():
            wanted_m = node.reference_m() + float(loop.reference.position(np.array(now - node.reference_s())))
            rows.append(float(session.newest[at.O_X]) - wanted_m)
    assert node.end_log(seconds) == 0
    settled = np.array(rows[round(0.5 / tick_s) :] or [np.nan])
    rmse = float(np.sqrt(np.mean(settled**2)))
    return Led(node.reason().decode(), bool(node.leads()), rmse, plant.drive.rejected, plant.drive.stage.state)
