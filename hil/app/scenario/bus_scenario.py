"""SCENARIO.toml on the bus: a closed loop as `capsule track` reads it, with the tables `[bus]` and `[[faults]]`, and
the drive's own where that is another maker's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import can

from hil.app.scenario.deployment import check_tick
from hil.app.scenario.reference import with_reference
from hil.app.scenario.scenario import BUS_TABLES, TABLES, TrackScenario, parse_track_scenario
from hil.bus.local import LocalBus
from hil.nodes.actuators import ACTUATORS, ActuatorTable, read_actuator
from hil.nodes.faults.table import KINDS, Fault, read_faults
from hil.nodes.fmu_plant import read_fmu
from hil.nodes.frame_map import frame_map_of, frames
from hil.nodes.plant_node import SLOT_S
from models.files.tables import from_table
from models.files.toml import read_toml, toml_text
from models.parameter import nearest


@dataclass(frozen=True)
class BusTable:
    """Table `[bus]`: whether the force sensor speaks too, and how many s of wall clock a simulated s may take before
    the run is failed; a run has at least 60 s.
    """

    force_sensor: bool = False
    longest_s_per_s: float = 60.0

    def __post_init__(self) -> None:
        if not self.longest_s_per_s > 0:
            raise ValueError(f"bus.longest_s_per_s must be positive; got {self.longest_s_per_s:g}")


@dataclass(frozen=True)
class FmuTable:
    """Table `[plant]`: the FMU, relative to the scenario, that steps in place of the simulated plant. What is sensed
    and how, and what hides in the sensors, stays the scenario's.
    """

    fmu: str


@dataclass(frozen=True)
class SilScenario:
    """A closed `loop` over the bus and what goes wrong in it. Its tick is the cycle of the drive's command frame where
    the file names none. `drive` is another maker's, which then is set up already.
    """

    loop: TrackScenario
    bus: BusTable = BusTable()
    faults: tuple[Fault, ...] = ()
    drive: ActuatorTable | None = None
    plant: FmuTable | None = None


def watched_bus(channel: str) -> LocalBus:
    """The local bus on which `capsule sil` shows a run and `capsule cockpit` sees it. Raises ValueError where there can
    be none.
    """
    try:
        return LocalBus(channel, fd=True)
    except can.CanInitializationError as error:
        raise ValueError(f"--watch must name a local bus that opens; got {channel!r}: {error}") from None


def load_sil_scenario(path: Path, reference: Path | None = None) -> tuple[SilScenario, str]:
    """Read and check a scenario file, with the reference of another one where that is given; with its text. A
    ValueError of one sentence says which key, what it must be and what it is.
    """
    raw, text = read_toml(path, "scenario")
    if reference is not None:
        raw = with_reference(raw, reference, "scenario")
        text = toml_text(raw)
    try:
        return _with_fmu(parse_sil_scenario(raw), path.parent), text
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _with_fmu(scenario: SilScenario, folder: Path) -> SilScenario:
    """The scenario with the path of its FMU as it counts from here, which is one that it can have."""
    if scenario.plant is None:
        return scenario
    path = folder / scenario.plant.fmu
    read_fmu(path, scenario.loop.truth)
    return replace(scenario, plant=FmuTable(str(path)))


def parse_sil_scenario(raw: Mapping[str, Any]) -> SilScenario:
    """A loop over the bus from parsed TOML. Errors as `load_sil_scenario`."""
    own = (*BUS_TABLES, *ACTUATORS)
    known = (*TABLES, *own)
    for name in raw:
        if name not in known:
            raise ValueError(f"tables must be among {', '.join(known)}; got [{name}]; {nearest(name, known)}")
    loop = parse_track_scenario({name: table for name, table in raw.items() if name not in own})
    if "tick_s" not in raw.get("control", {}):
        cycle = frames()[frame_map_of(loop.kind).command].cycle_s
        loop = replace(loop, control=replace(loop.control, tick_s=cycle))
    slots = loop.control.tick_s / SLOT_S
    if round(slots) < 1 or abs(slots - round(slots)) > 1e-6:
        raise ValueError(f"control.tick_s must be a multiple of {SLOT_S:g} s on the bus; got {loop.control.tick_s:g}")
    check_tick(loop.control.tick_s, loop.kind, loop.limits)
    bus = raw.get("bus", {})
    if not isinstance(bus, Mapping):
        raise ValueError(f"bus must be a table; got {bus!r}")
    faults = read_faults(raw.get("faults", []), loop.duration_s)
    drive = read_actuator(raw, loop.kind)
    makers = [fault.kind for fault in faults if KINDS[fault.kind].makers]
    if makers and drive is None:
        raise ValueError(f"faults.kind {makers[0]} must stand with one of [{'], ['.join(ACTUATORS)}], whose it is")
    plant = from_table(FmuTable, raw["plant"], "plant") if "plant" in raw else None
    return SilScenario(loop, from_table(BusTable, bus, "bus"), faults, drive, plant)
