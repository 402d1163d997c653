"""The makers whose drives a deployment or a scenario may name, each by its own table."""

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
    """The `table` of a file, the set-up of its drive, and the `bus` on which the drive is the catalogue's carriage.

    `set_up(bus, table, limits, tick_s, faulty=False)` finds the drive and checks its state: it must rest at a known
    position and stop by itself without commands. It writes the settings for our commands; the drive stays disabled.
    It blocks for some seconds at most, plus the homing time. With `faulty` the drive may have a fault, which is about
    to be acknowledged. It returns a sentence for each setting that was rounded or cannot be read, and raises ValueError
    of one sentence if the drive does not answer or fails a check.
    """

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
    """The drive that a file names for a rig of `kind`, None for the catalogue's. Raises ValueError of one sentence."""
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
