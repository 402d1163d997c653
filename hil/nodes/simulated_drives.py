"""Drives of other makers, simulated: the plant's side of `hil.nodes.actuators`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import can

from controller.limits import Limits
from hil.nodes.actuators import ActuatorTable
from hil.nodes.cia402.states import Cia402Table
from hil.nodes.drive.power_stage import CarriagePower, Power
from hil.nodes.drive.state_machine import Stage
from hil.nodes.moteus.drive import MoteusDrive
from hil.nodes.odrive.actuator import OdriveTable
from hil.nodes.odrive.drive import OdriveDrive


class SimulatedDrive(Protocol):
    """What a plant node needs of a drive, and a bench of its faults."""

    heated_to_C: float
    misread: Callable[[float], float] | None
    good_at: float
    broken: bool
    node_id: int

    @property
    def power(self) -> Power:
        """Its power stage."""
        ...

    @property
    def rejected(self) -> int:
        """Frames refused, or not sent, so far."""
        ...

    @property
    def safe(self) -> bool:
        """Whether it follows no command and is in its safe state."""
        ...

    @property
    def stage(self) -> Stage:
        """State and fault in the catalogue's numbers."""
        ...

    def boot(self, now: float) -> None:
        """Begin anew."""
        ...

    def listen(self, now: float, slots: int) -> None:
        """One run of its firmware."""
        ...

    def output(self, dt: float, sensed: float) -> float:
        """The plant's command for the next `dt` s."""
        ...


@runtime_checkable
class Configured(Protocol):
    """A drive that does nothing before it has been set up."""

    def configure(self, time_to_live_ms: int) -> None:
        """Set it up, in simulation, for commands that live so long."""
        ...


def simulated_drive(
    bus: can.BusABC, table: ActuatorTable, power: Power, limits: Limits, tick_s: float
) -> SimulatedDrive:
    """The drive that `table` names. Raises ValueError for one that is no carriage."""
    if not isinstance(power, CarriagePower):
        raise ValueError("rig.kind must be magnetic with a drive of another maker, whose carriage it is")
    if isinstance(table, Cia402Table):
        from hil.nodes.cia402.drive import Cia402Drive

        return Cia402Drive(bus, table, power, limits, tick_s)
    if isinstance(table, OdriveTable):
        return OdriveDrive(bus, table, power, limits, tick_s)
    return MoteusDrive(bus, table, power, limits, tick_s)
