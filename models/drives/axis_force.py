"""A force (or torque) that drives an axis, as it is logged."""

from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

from models.drives.drive import Actuation, Drive, Push, Values
from models.parameter import Parameter
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
    constant: ClassVar[tuple[str, str]] = ("", "")
    """Parameter and unit of the force per ampere or volt, where the command is one and that is not known."""
    holds: bool = True

    @property
    def stepped(self) -> bool:
        return self.holds

    def parameters(self) -> tuple[Parameter, ...]:
        name, unit = self.constant
        return (Parameter(name, 1.0, unit, 1e-9, 1e9, "records alone", fit=True),) if name else ()

    def _per(self, p: Values) -> Any:
        """Force per unit of the command."""
        return p[self.constant[0]] if self.constant[0] else 1.0

    def push(self, at: Actuation) -> Push:
        return Push(at.gain * self._per(at.p) * at.command - at.p[self.rail.names[3]], self.inertia(at.p))

    def inertia(self, p: Values) -> Any:
        return p[self.rail.names[0]]

    def force(self, x: Any, v: Any, command: Any, p: Values) -> Any:
        return self._per(p) * command - p[self.rail.names[3]]

    def command_for(self, force: Any, x: Any, v: Any, p: Values) -> Any:
        return (force + p[self.rail.names[3]]) / self._per(p)


@dataclass(frozen=True)
class AxisTorque(AxisForce):
    """The torque in N m about an axis."""

    commanded: ClassVar[str] = "torque_N_m"
    measured: ClassVar[str] = "angle_rad"
    rail: ClassVar[Rail] = TURN


@cache
def by(drive: type[AxisForce], column: str) -> type[AxisForce]:
    """The `drive` of an axis that the current or voltage in a `column` pushes, through a constant that is not known."""
    unit = column.rpartition("_")[2]
    word, of = ("torque", "N_m") if drive.rail is TURN else ("force", "N")
    constant = (f"{word}_constant_{of}_per_{unit}", f"{of.replace('_', ' ')}/{unit}")
    return type(drive.__name__, (drive,), {"commanded": column, "constant": constant, "__doc__": drive.__doc__})
