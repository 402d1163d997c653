"""`capsule plant`: the simulated drive side alone, in real time on a deployment's bus, where no rig is at hand."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can
import numpy as np

from controller.limits import Limits
from hil.app.console import output_to_notes, print_json
from hil.app.run.clock import Clock, ClockedBus, Grid
from hil.app.run.command import open_bus
from hil.app.run.loop import Signals, prepare_process
from hil.app.scenario.deployment import BusTable, read_plant
from hil.app.scenario.scenario import load_track_scenario
from hil.nodes.cia402.states import Cia402Table
from hil.nodes.drive.power_stage import CarriagePower
from hil.nodes.plant_node import SLOT_S, PlantNode, power_of
from plant import layout as at
from plant.session import Session

if TYPE_CHECKING:
    from hil.nodes.cia402.drive import Cia402Drive


def plant(path: Path, seconds: float | None = None, *, json_output: bool = False) -> None:
    """Put the plant of the deployment file `path` on its bus for `seconds`, else until Ctrl-C or SIGTERM, and print
    "ready" once it is there. With `json_output` that goes to standard error, and at the end what became of the plant,
    the truth included, to standard output.

    Raises ValueError, one sentence, for a file that names no plant and for a bus that does not open.
    """
    if seconds is not None and not 0 < seconds <= 1e6:
        raise ValueError(f"--seconds must be more than 0 and at most 1e6; got {seconds:g}")
    deployed = read_plant(path)
    told = sys.stderr if json_output else sys.stdout
    with output_to_notes():
        try:
            found = run_plant(
                deployed.scenario,
                deployed.bus,
                seconds or float("inf"),
                deployed.priority,
                cia402=deployed.cia402,
                ready=lambda: print("ready", file=told, flush=True),
            )
        except ValueError as error:
            raise ValueError(str(error) if str(error).startswith(str(path.parent)) else f"{path}: {error}") from None
    if json_output:
        print_json(found)


def run_plant(
    scenario_path: Path,
    bus_table: BusTable,
    seconds: float,
    priority: int = 0,
    *,
    cia402: Cia402Table | None = None,
    ready: Callable[[], None] = lambda: None,
) -> dict[str, Any]:
    """Put the plant of a scenario on a bus for `seconds` or until a signal; what became of it, the truth included.

    With `cia402` it is a carriage that speaks CANopen. The plant's time is the wall clock's, `priority` as in a
    deployment: slots that come late are made up for at once, so it never runs slow.
    """
    scenario = load_track_scenario(scenario_path)
    Session(scenario.truth, scenario.instruments, scenario.seed, 0.0).advance(0.0, SLOT_S)
    raw = open_bus(bus_table)
    clock = Clock()
    bus = ClockedBus(raw, clock)
    session = Session(scenario.truth, scenario.instruments, scenario.seed, 0.0)
    carriage = None if cia402 is None else _cia402(session, scenario.limits, bus, cia402)
    node = PlantNode(session, scenario.limits, 2 * SLOT_S, bus, bus, drive=carriage)
    prepare_process(priority, -1)
    ready()
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


def _cia402(session: Session, limits: Limits, bus: can.BusABC, table: Cia402Table) -> Cia402Drive:
    """The scenario's carriage as a CANopen drive. Raises ValueError for another kind of drive."""
    from hil.nodes.cia402.drive import Cia402Drive

    kind, power = power_of(session, limits)
    if not isinstance(power, CarriagePower):
        raise ValueError(f"[cia402] must be a carriage; got a rig of kind {kind}")
    return Cia402Drive(bus, table, power, limits, 2 * SLOT_S)
