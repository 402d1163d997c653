"""Drives of other makers that a deployment or a scenario may name by a table of their own: how the controller's side
sets one up and speaks with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final

import can

from controller.limits import Limits
from hil.bus.catalogue import Catalogue
from hil.nodes.carriage_bus import CarriageBus
from hil.nodes.cia402.bus import Cia402Bus
from hil.nodes.cia402.setup import set_up as set_up_cia402
from hil.nodes.cia402.states import MASTER_NODE, SYNC_ID, Cia402Table, options_of
from hil.nodes.frame_map import frame_map_of
from hil.nodes.moteus.actuator import MoteusBus, MoteusTable
from hil.nodes.moteus.actuator import set_up as set_up_moteus
from hil.nodes.moteus.registers import HOST, PREFIXES, REPLY_WANTED
from hil.nodes.odrive.actuator import OdriveBus, OdriveTable
from hil.nodes.odrive.actuator import set_up as set_up_odrive
from models.files.tables import from_table

ActuatorTable = Cia402Table | OdriveTable | MoteusTable
ACTUATORS: Final[Mapping[str, type[ActuatorTable]]] = MappingProxyType(
    {"cia402": Cia402Table, "odrive": OdriveTable, "moteus": MoteusTable}
)
"""The tables by their name in a file."""


def read_actuator(raw: Mapping[str, Any], kind: str) -> ActuatorTable | None:
    """The drive that a file's tables name for a rig of `kind`, None where it is the catalogue's own. Raises ValueError
    of one sentence.
    """
    named = [name for name in ACTUATORS if name in raw]
    if not named:
        return None
    if len(named) > 1:
        raise ValueError(f"tables must name one drive; got [{'], ['.join(named)}]")
    if kind != "magnetic":
        raise ValueError(f"{named[0]} must stand with rig.kind magnetic, whose carriage it is; got {kind!r}")
    found: ActuatorTable = from_table(ACTUATORS[named[0]], raw[named[0]], named[0], skip=("options",))
    if isinstance(raw[named[0]], Mapping) and "options" in raw[named[0]]:
        if not isinstance(found, Cia402Table):
            raise ValueError(f"options must stand in [cia402]; got them in [{named[0]}]")
        return replace(found, options=options_of(raw[named[0]]["options"]))
    return found


def needs_fd(table: ActuatorTable | None) -> bool:
    """Whether the drive's frames are CAN FD."""
    return isinstance(table, MoteusTable)


def identifiers(table: ActuatorTable) -> tuple[frozenset[int], frozenset[int]]:
    """The identifiers by which the drive is spoken to, and those by which it speaks."""
    node = table.node_id
    if isinstance(table, Cia402Table):
        return frozenset({0x200 + node, SYNC_ID, 0x700 + MASTER_NODE}), frozenset(
            {0x180 + node, 0x280 + node, 0x700 + node}
        )
    if isinstance(table, OdriveTable):
        both = frozenset(node << 5 | command for command in range(32))
        return both, both
    own, session = (prefix << 16 for prefix in PREFIXES)
    told, says = REPLY_WANTED | HOST << 8 | node, node << 8 | HOST
    return frozenset({own | told, session | told}), frozenset({own | says, session | says})


def set_up(bus: can.BusABC, table: ActuatorTable, limits: Limits, tick_s: float) -> list[str]:
    """Set the drive up and see that it stops by itself without commands; it stays disabled. Gives a sentence for each
    setting that it took rounded, or may do without. Raises ValueError of one sentence.
    """
    if isinstance(table, Cia402Table):
        return set_up_cia402(bus, table, limits, tick_s, frame_map_of("magnetic").life_ms(limits.carriage_speed_m_s))
    if isinstance(table, MoteusTable):
        return set_up_moteus(bus, table, limits)
    set_up_odrive(bus, table, limits, tick_s)
    return []


def carriage_bus(inner: can.BusABC, table: ActuatorTable, catalogue: Catalogue, tick_s: float) -> CarriageBus:
    """The bus on which the drive is the catalogue's carriage."""
    if isinstance(table, Cia402Table):
        return Cia402Bus(inner, table, catalogue, tick_s)
    if isinstance(table, OdriveTable):
        return OdriveBus(inner, table, catalogue, tick_s)
    return MoteusBus(inner, table, catalogue, tick_s)
