"""`capsule plant`: the simulated drive side alone, in real time on the bus of a deployment."""

import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

from hil.app.console import output_to_notes, print_json
from hil.app.run.clock import Clock, ClockedBus, Grid
from hil.app.run.loop import StopSignals
from hil.app.run.machine import open_bus, prepare_process
from hil.app.scenario.deployment import DeployedPlant, read_plant
from hil.app.scenario.scenario import load_track_scenario
from hil.app.shared_options import Json, argument, option, several
from hil.bus.authenticated import AuthenticatedBus
from hil.simulated.faults import Fault, read_lie
from hil.simulated.plant_node import SLOT_S, PlantNode, power_of, simulated_drive
from models.files.toml import in_file
from plant import layout as at
from plant.session import Session


def plant(
    path: Annotated[Path, argument("DEPLOYMENT.toml", reads="deployment file")],
    *,
    seconds: Annotated[float | None, option("--seconds", "S")] = None,
    lies: Annotated[list[str], several("--lie", "KIND[:TARGET][=VALUE][@S]")],
    json_output: Json = False,
) -> None:
    """Put the plant on its bus and print "ready" (to standard error with `--json`); at the end print the counts."""
    if seconds is not None and not 0 < seconds <= 1e6:
        raise ValueError(f"--seconds must be more than 0 and at most 1e6; got {seconds:g}")
    deployed, faults = read_plant(path), [read_lie(text) for text in lies]
    stream = sys.stderr if json_output else sys.stdout
    with output_to_notes(), in_file(path):
        found = run_plant(deployed, seconds or math.inf, faults, lambda: print("ready", file=stream, flush=True))
    if json_output:
        print_json(found)


def run_plant(
    deployed: DeployedPlant, seconds: float, lies: Sequence[Fault] = (), ready: Callable[[], None] = lambda: None
) -> dict[str, Any]:
    """Run a plant on its bus for `seconds` or until a signal; its counts. Late slots are caught up."""
    scenario, drive = load_track_scenario(deployed.scenario), deployed.drive
    for fault in lies:
        fault.check_rig(scenario.kind)
    due = sorted(lies, key=lambda fault: fault.at_s)
    Session(scenario.truth, scenario.instruments, scenario.seed, 0.0).advance(0.0, SLOT_S)
    raw = open_bus(deployed.bus, deployed.folder)
    clock = Clock()
    bus = ClockedBus(raw, clock)
    session = Session(scenario.truth, scenario.instruments, scenario.seed, 0.0, keeps=False)
    _, power = power_of(session, scenario.limits)
    foreign = None if drive is None else simulated_drive(bus, drive, power, scenario.limits, 2 * SLOT_S)
    node = PlantNode(session, scenario.limits, 2 * SLOT_S, bus, bus, drive=foreign)
    prepare_process(deployed.priority, -1)
    ready()
    grid, slots = Grid(clock, SLOT_S), 0
    states: dict[int, int] = {}
    with StopSignals().caught() as signals:
        while slots * SLOT_S < seconds and not signals.wanted:
            now = grid.wait()
            while slots * SLOT_S <= now:
                while due and due[0].at_s <= slots * SLOT_S:
                    node.spoil(due.pop(0))
                node.tick(slots * SLOT_S)
                slots += 1
            states[node.drive.stage.state] = states.get(node.drive.stage.state, 0) + 1
    bus.shutdown()
    return {
        "slots": slots,
        "missed": grid.missed,
        "late_ms": grid.late.document(),
        "rejected": node.drive.rejected,
        "unauthenticated": dict(raw.refused) if isinstance(raw, AuthenticatedBus) else {},
        "state": node.drive.stage.state,
        "slots_in_state": states,
        "fault": node.drive.stage.fault,
        "moved_m": float(session.newest[at.O_X]),
    }
