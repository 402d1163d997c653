"""A force (or torque) that drives an axis, as it is logged."""

from dataclasses import dataclass
from typing import Any, ClassVar

from models.drives.drive import Actuation, Drive, Push, Values
from models.surfaces.surface import LINE, TURN, Rail


@dataclass(frozen=True)
class AxisForce(Drive):
    """The force in N along an axis; the axis itself, with its inertia and constant offset, is its `rail`. `holds`:
    a sample holds until the next, as a controller's command does; else it changes linearly, as a measured force does.
    """

    name: ClassVar[str] = "driven_axis"
    commanded: ClassVar[str] = "force_N"
    measured: ClassVar[str] = "position_m"
    rail: ClassVar[Rail] = LINE
    turning: ClassVar[bool] = True
    launched: ClassVar[bool] = True
    remembers_s: ClassVar[float] = 0.2
    leaves_open: ClassVar[tuple[str, ...]] = ()
    holds: bool = True

    @property
    def stepped(self) -> bool:
        return self.holds

    def push(self, at: Actuation) -> Push:
        return Push(at.gain * at.command - at.p[self.rail.names[3]], self.inertia(at.p))

    def inertia(self, p: Values) -> Any:
        return p[self.rail.names[0]]

    def force(self, x: Any, v: Any, command: Any, p: Values) -> Any:
        return command - p[self.rail.names[3]]

    def command_for(self, force: Any, x: Any, v: Any, p: Values) -> Any:
        return force + p[self.rail.names[3]]


@dataclass(frozen=True)
class AxisTorque(AxisForce):
    """The torque in N m about an axis."""

    commanded: ClassVar[str] = "torque_N_m"
    measured: ClassVar[str] = "angle_rad"
    rail: ClassVar[Rail] = TURN
