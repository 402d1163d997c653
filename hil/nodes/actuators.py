"""Drives of other makers that a deployment or a scenario may name by a table of their own: how the controller's side
sets one up and speaks with it.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

import can

from controller.limits import Limits
from hil.bus.catalogue import Catalogue
from hil.nodes.carriage_bus import CarriageBus
from hil.nodes.cia402.bus import Cia402Bus
from hil.nodes.cia402.setup import set_up as set_up_cia402
from hil.nodes.cia402.states import MASTER_NODE, SYNC_ID, Cia402Table, options_of
from hil.nodes.frame_map import CARRIAGE_MAP
from hil.nodes.moteus.actuator import MoteusBus
from hil.nodes.moteus.registers import HOST, PREFIXES, REPLY_WANTED
from hil.nodes.moteus.setup import set_up as set_up_moteus
from hil.nodes.moteus.table import MoteusTable
from hil.nodes.odrive.actuator import OdriveBus
from hil.nodes.odrive.setup import set_up as set_up_odrive
from hil.nodes.odrive.table import OdriveTable, endpoints_of
from models.files.tables import from_table

ActuatorTable = Cia402Table | OdriveTable | MoteusTable
ACTUATORS: Final[Mapping[str, type[ActuatorTable]]] = {
    "cia402": Cia402Table,
    "odrive": OdriveTable,
    "moteus": MoteusTable,
}
"""The tables by their name in a file."""
_NESTED: Final[Mapping[str, tuple[str, Callable[[object], Any]]]] = {
    "options": ("cia402", options_of),
    "endpoints": ("odrive", endpoints_of),
}
"""Tables within one of them: whose they are, and how each is read."""


def read_actuator(raw: Mapping[str, Any], kind: str, limits: Limits) -> ActuatorTable | None:
    """The drive that a file's tables name for a rig of `kind`, led within `limits`, None where it is the catalogue's
    own. Raises ValueError of one sentence.
    """
    named = [name for name in ACTUATORS if name in raw]
    if not named:
        return None
    if len(named) > 1:
        raise ValueError(f"tables must name one drive; got [{'], ['.join(named)}]")
    if kind != CARRIAGE_MAP.drive.name:
        raise ValueError(f"{named[0]} must stand with rig.kind magnetic, whose carriage it is; got {kind!r}")
    name = named[0]
    found: ActuatorTable = from_table(ACTUATORS[name], raw[name], name, skip=tuple(_NESTED))
    for key, (owner, read) in _NESTED.items():
        if not isinstance(raw[name], Mapping) or key not in raw[name]:
            continue
        if owner != name:
            raise ValueError(f"{key} must stand in [{owner}]; got them in [{name}]")
        found = replace(found, **{key: read(raw[name][key])})
    if isinstance(found, OdriveTable):
        found.check_speed(limits.carriage_speed_m_s)
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


def set_up(bus: can.BusABC, table: ActuatorTable, limits: Limits, tick_s: float, *, faulty: bool = False) -> list[str]:
    """Set the drive up and see that it rests and stops by itself without commands; it stays disabled. Gives a sentence
    for each setting that it took rounded or does not tell. `faulty`: its fault is to be acknowledged, so it may have
    one. Raises ValueError of one sentence.
    """
    if isinstance(table, Cia402Table):
        life_ms = CARRIAGE_MAP.life_ms(limits.carriage_speed_m_s)
        return set_up_cia402(bus, table, limits, tick_s, life_ms, faulty=faulty)
    if isinstance(table, OdriveTable):
        return set_up_odrive(bus, table, limits, tick_s, faulty=faulty)
    return set_up_moteus(bus, table, limits)


def carriage_bus(inner: can.BusABC, table: ActuatorTable, catalogue: Catalogue, tick_s: float) -> CarriageBus:
    """The bus on which the drive is the catalogue's carriage."""
    if isinstance(table, Cia402Table):
        return Cia402Bus(inner, table, catalogue, tick_s)
    if isinstance(table, OdriveTable):
        return OdriveBus(inner, table, catalogue, tick_s)
    return MoteusBus(inner, table, catalogue, tick_s)
