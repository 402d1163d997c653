"""A simulated plant in real time, in a process of its own: what `capsule run` leads where no drive is at hand."""

from __future__ import annotations

import json
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can
import numpy as np

from controller.limits import Limits
from hil.app.run.clock import Clock, ClockedBus, Grid
from hil.app.run.command import open_bus
from hil.app.run.loop import Signals, prepare_process
from hil.app.scenario.deployment import BusTable
from hil.app.scenario.scenario import load_track_scenario
from hil.nodes.cia402.states import Cia402Table
from hil.nodes.drive.power_stage import CarriagePower
from hil.nodes.plant_node import SLOT_S, PlantNode, power_of
from plant import layout as at
from plant.session import Session

if TYPE_CHECKING:
    from hil.nodes.cia402.drive import Cia402Drive


def run_plant(
    scenario_path: Path, interface: str, channel: str, seconds: float, priority: int = 0, drive: str = "own"
) -> dict[str, Any]:
    """Put the plant of a scenario on a bus for `seconds` or until a signal; what became of it, the truth included.

    `drive` "cia402" is a carriage that speaks CANopen. The plant's time is the wall clock's, `priority` as in a
    deployment: slots that come late are made up for at once, so it never runs slow.
    """
    scenario = load_track_scenario(scenario_path)
    Session(scenario.truth, scenario.instruments, scenario.seed, 0.0).advance(0.0, SLOT_S)
    raw = open_bus(BusTable(interface, channel))
    clock = Clock()
    bus = ClockedBus(raw, clock)
    session = Session(scenario.truth, scenario.instruments, scenario.seed, 0.0)
    carriage = _cia402(session, scenario.limits, bus) if drive == "cia402" else None
    node = PlantNode(session, scenario.limits, 2 * SLOT_S, bus, bus, drive=carriage)
    prepare_process(priority, -1)
    print("ready", flush=True)
    grid, slots = Grid(clock, SLOT_S), 0
    states: dict[int, int] = {}
    with Signals().caught() as signals:
        while slots * SLOT_S < seconds and not signals.wanted:
            now = grid.wait()
            while slots * SLOT_S <= now:
                node.tick(slots * SLOT_S)
                slots += 1
            states[node.drive.stage.state] = states.get(node.drive.stage.state, 0) + 1
    bus.shutdown()
    place = np.concatenate(node.session.rows)[:, at.O_X]
    return {
        "slots": slots,
        "missed": grid.missed,
        "late_ms": grid.late.document(),
        "rejected": node.drive.rejected,
        "state": node.drive.stage.state,
        "slots_in_state": states,
        "fault": node.drive.stage.fault,
        "moved_m": float(place[-1] - place[0]),
    }


def _cia402(session: Session, limits: Limits, bus: can.BusABC) -> Cia402Drive:
    """The scenario's carriage as a CANopen drive. Raises ValueError for another kind of drive."""
    from hil.nodes.cia402.drive import Cia402Drive

    kind, power = power_of(session, limits)
    if not isinstance(power, CarriagePower):
        raise ValueError(f"drive cia402 must be a carriage; got a rig of kind {kind}")
    return Cia402Drive(bus, Cia402Table(), power, limits, 2 * SLOT_S)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    found = run_plant(Path(sys.argv[1]), sys.argv[2], sys.argv[3], float(sys.argv[4]), int(sys.argv[5]), *sys.argv[6:])
    print(json.dumps(found), flush=True)
