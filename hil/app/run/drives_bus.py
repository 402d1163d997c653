"""The bus of a deployment: opened, heard for another controller, and the drive of another maker set up on it."""

from pathlib import Path
from typing import Final

import can

from hil.app.console import note
from hil.app.run.clock import ClockedBus
from hil.app.run.machine import open_bus
from hil.app.scenario.deployment import Deployment
from hil.bus.authenticated import AuthenticatedBus
from hil.bus.local import LocalBus
from hil.bus.wrapping import heard_for, plain
from hil.drives.carriage_bus import CarriageBus
from hil.drives.makers import MAKERS
from hil.drives.table import ActuatorTable
from hil.nodes.frame_map import controllers_frames
from hil.nodes.receive import operators_stop
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
QUIET_S: Final = 0.1
"""How long to listen before anything is sent: five cycles of a controller's slowest frame."""


def drives_bus(deployment: Deployment, folder: Path, listen_only: bool, faulty: bool) -> can.BusABC:
    """The deployment's bus; another maker's drive is set up, unless nothing may be sent. Raises ValueError."""
    bus, table = open_bus(deployment.bus, folder), deployment.drive
    if not listen_only and (others := _controllers_on(bus, table)):
        bus.shutdown()
        raise OtherControllerError(TEXT("end.other_controller", frames=", ".join(others)))
    if table is None:
        return bus
    if not listen_only:
        try:
            limits, tick_s = deployment.limits, deployment.control.tick_s
            for sentence in MAKERS[table.where].set_up(bus, table, limits, tick_s, faulty=faulty):
                note(sentence)
        except ValueError:
            bus.shutdown()
            raise
    return MAKERS[table.where].bus(bus, table, deployment.control.tick_s)


class OtherControllerError(Exception):
    """Another controller has been heard before anything was sent."""


def _controllers_on(bus: can.BusABC, table: ActuatorTable | None) -> list[str]:
    """Names of the frames heard within `QUIET_S` that only a controller sends."""
    known, heard = controllers_frames(), set[str]()
    for message in heard_for(bus, QUIET_S):
        if plain(message) and message.arbitration_id in known and not operators_stop(message):
            heard.add(known[message.arbitration_id])
        elif table is not None and table.orders(message):
            heard.add("commands to the drive")
    return sorted(heard)


def overruns(bus: can.BusABC) -> int:
    """Frames for which there was no room in another node's queue, as the local bus counts them."""
    while isinstance(bus, ClockedBus | CarriageBus | AuthenticatedBus):
        bus = bus.inner
    return bus.overruns if isinstance(bus, LocalBus) else 0
