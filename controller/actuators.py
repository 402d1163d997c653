"""Static inverses of the drives that push a body: the command for a force."""

import math
from collections.abc import Mapping
from typing import Any

from controller.limits import Envelope
from models.drives.drive import Drive

Numbers = Mapping[str, float]


class Actuator:
    """The static inverse of a drive at the parameters `p`: the command that pushes with a force in N at a place and
    speed, within the range of the `envelope`.
    """

    def __init__(self, drive: Any, p: Numbers, envelope: Envelope) -> None:
        self._drive, self._p, self._envelope = drive, p, envelope

    def command(self, force: float, x: float, v: float) -> float:
        """Command in the drive's unit for `force` in N at `x` in m and `v` in m/s."""
        return min(max(float(self._drive.command_for(force, x, v, self._p)), self._envelope.low), self._envelope.high)

    def force(self, command: float, x: float, v: float) -> float:
        """The force in N of a command held for long: the inverse of `command`."""
        return float(self._drive.force(x, v, command, self._p))


class CarriageActuator(Actuator):
    """The carriage's position in m on the stable branch of the magnet."""

    def command(self, force: float, x: float, v: float) -> float:
        return x + math.copysign(gap_of_force(abs(force), self._drive, self._p, self._envelope.gap_m), force)


class CoilActuator(Actuator):
    """The coil's current in A, or the voltage in V that holds it, back-EMF included."""

    def command(self, force: float, x: float, v: float) -> float:
        p = self._p
        current = force / p["coil_force_N_per_A"]
        if self._drive.by_voltage:
            current = current * p["coil_resistance_ohm"] + p["back_emf_V_s_per_m"] * v
        return min(max(current, self._envelope.low), self._envelope.high)

    def force(self, command: float, x: float, v: float) -> float:
        if self._drive.by_voltage:
            command = (command - self._p["back_emf_V_s_per_m"] * v) / self._p["coil_resistance_ohm"]
        return super().force(command, x, v)


def gap_of_force(force: float, drive: Drive, p: Numbers, most: float) -> float:
    """The gap in m up to `most`, on the stable branch, at which the magnet with the parameters `p` pulls `force` in N;
    `most` where it never does.
    """

    def pull(gap: float) -> float:
        return float(drive.force(0.0, 0.0, gap, p))

    if pull(most) <= force:
        return most
    low, high = 0.0, most
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if pull(middle) <= force else (low, middle)
    return low
