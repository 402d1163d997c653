"""What a plant takes and shows by name: the variables of an FMU of it, and of one that stands in for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from plant import layout as at
from plant.drives.kinds import Coil, Drive, Pull, Vibro


@dataclass(frozen=True)
class Named:
    """A variable: `place` is where the plant's state has it, `column` where its rows do, -1 where they do not."""

    name: str
    unit: str
    description: str
    place: int = -1
    column: int = -1


WALL: Final = Named("wall_displacement_m", "m", "by which the wall is dragged", at.S_U, at.O_U)
FORCE: Final = Named("force_N", "N", "drive's force (a pull's own) in the last step", column=at.O_FORCE)
_EVERY: Final = (
    Named("position_m", "m", "capsule along the lumen", at.S_X, at.O_X),
    Named("velocity_m_s", "m/s", "capsule's speed", at.S_V, at.O_V),
    WALL,
)
_CURRENT: Final = Named("coil_current_A", "A", "coil's current", at.S_CURRENT, at.O_CURRENT)
_INNER: Final = (
    Named("inner_position_m", "m", "inner mass along the lumen", at.S_INNER_X, at.O_INNER_X),
    Named("inner_velocity_m_s", "m/s", "inner mass's speed", at.S_INNER_V, at.O_INNER_V),
)


def input_of(drive: Drive) -> Named:
    """The command of a drive."""
    if isinstance(drive, Pull):
        return Named("pull_position_m", "m", "imposed position, reached at the end of a communication step")
    if _by_coil(drive):
        return Named("coil_voltage_V", "V", "coil's voltage, held over a communication step")
    if isinstance(drive, Vibro):
        return Named("drive_on", "1", "share 0..1 of the drive's force, held over a communication step")
    return Named("carriage_position_m", "m", "carriage, reached at the end of a communication step")


def outputs_of(drive: Drive) -> list[Named]:
    """What a rig with this drive shows beside the force."""
    return [*_EVERY, *([_CURRENT] if _by_coil(drive) else []), *(_INNER if isinstance(drive, Vibro) else [])]


def _by_coil(drive: Drive) -> bool:
    return isinstance(drive, Coil) or (isinstance(drive, Vibro) and drive.coil is not None)
