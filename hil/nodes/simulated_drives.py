"""Drives of other makers, simulated: the plant's side of `hil.nodes.actuators`."""

import can

from controller.limits import Limits
from hil.nodes.actuators import ActuatorTable
from hil.nodes.cia402.states import Cia402Table
from hil.nodes.drive.makers import MakersDrive
from hil.nodes.drive.power_stage import CarriagePower, Power
from hil.nodes.moteus.drive import MoteusDrive
from hil.nodes.odrive.drive import OdriveDrive
from hil.nodes.odrive.table import OdriveTable


def simulated_drive(bus: can.BusABC, table: ActuatorTable, power: Power, limits: Limits, tick_s: float) -> MakersDrive:
    """The drive that `table` names. Raises ValueError for one that is no carriage."""
    if not isinstance(power, CarriagePower):
        raise ValueError("rig.kind must be magnetic with a drive of another maker, whose carriage it is")
    if isinstance(table, Cia402Table):
        from hil.nodes.cia402.drive import Cia402Drive

        return Cia402Drive(bus, table, power, limits, tick_s)
    if isinstance(table, OdriveTable):
        return OdriveDrive(bus, table, power, limits, tick_s)
    return MoteusDrive(bus, table, power, limits, tick_s)
