"""The makers whose drives a deployment or a scenario may name by a table of their own."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import can

from controller.limits import Limits
from hil.drives.carriage_bus import CarriageBus
from hil.drives.cia402_bus import Cia402Bus
from hil.drives.cia402_protocol import Cia402Table
from hil.drives.cia402_setup import set_up as set_up_cia402
from hil.drives.moteus_bus import MoteusBus
from hil.drives.moteus_protocol import MoteusTable
from hil.drives.moteus_setup import set_up as set_up_moteus
from hil.drives.odrive_bus import OdriveBus
from hil.drives.odrive_protocol import OdriveTable
from hil.drives.odrive_setup import set_up as set_up_odrive
from hil.drives.table import ActuatorTable
from hil.nodes.frame_map import CARRIAGE_MAP


@dataclass(frozen=True)
class Maker:
    """What a file says of its drives (`table`), what sets one up, and the bus on which it is our carriage."""

    table: type[ActuatorTable]
    set_up: Callable[..., list[str]]
    bus: Callable[[can.BusABC, Any, float], CarriageBus]


MAKERS: Final = {
    one.table.where: one
    for one in (
        Maker(Cia402Table, set_up_cia402, Cia402Bus),
        Maker(OdriveTable, set_up_odrive, OdriveBus),
        Maker(MoteusTable, set_up_moteus, MoteusBus),
    )
}
ACTUATORS: Final[Mapping[str, type[ActuatorTable]]] = {name: maker.table for name, maker in MAKERS.items()}


def read_actuator(raw: Mapping[str, Any], kind: str, limits: Limits) -> ActuatorTable | None:
    """The drive that a file names for a rig of `kind`, None: the catalogue's own. Raises ValueError of one sentence."""
    named = [name for name in ACTUATORS if name in raw]
    if not named:
        return None
    if len(named) > 1:
        raise ValueError(f"tables must name one drive; got [{'], ['.join(named)}]")
    name = named[0]
    if kind != CARRIAGE_MAP.drive.name:
        raise ValueError(f"{name} must stand with rig.kind magnetic, whose carriage it is; got {kind!r}")
    found = ACTUATORS[name].read(raw)
    found.check_speed(limits.carriage_speed_m_s)
    return found


def set_up(bus: can.BusABC, table: ActuatorTable, limits: Limits, tick_s: float, *, faulty: bool = False) -> list[str]:
    """Find the drive, see what it is doing, that it rests where it knows its place and stops by itself without
    commands, and give it what it is led by; it stays disabled. Blocks, at most some seconds and the time to home.
    `faulty`: its fault is to be acknowledged, so it may have one. Gives a sentence for each setting that it took
    rounded or does not tell. Raises ValueError of one sentence where it does not answer or is not as it must be.
    """
    return MAKERS[table.where].set_up(bus, table, limits, tick_s, faulty=faulty)


def carriage_bus(inner: can.BusABC, table: ActuatorTable, tick_s: float) -> CarriageBus:
    """The bus on which the drive is the catalogue's carriage."""
    return MAKERS[table.where].bus(inner, table, tick_s)
