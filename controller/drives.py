"""What a controller needs to know of each drive, in one table: its limits in the command's unit, and the static inverse
that a PID on the force commands it by.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from controller.limits import Envelope, Limits
from controller.model.control_model import ControlModel
from controller.model.friction import mean_friction
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


def _carriage(drive: Any, limits: Limits) -> Envelope:
    nominal = {p.name: p.value for p in drive.parameters()}
    gap = gap_of_force(limits.force_N, drive, nominal, limits.gap_share * drive.gap_limit_m)
    speed, acceleration = limits.carriage_speed_m_s, limits.carriage_acceleration_m_s2
    return Envelope("magnetic", -limits.travel_m, limits.travel_m, speed, acceleration, gap, 1.0, limits, placed=True)


def _coil(drive: Any, limits: Limits) -> Envelope:
    gain = drive.force_constant_N_per_A
    most = limits.current_A if gain == 0 else min(limits.current_A, limits.force_N / abs(gain))
    sense = math.copysign(1.0, gain)
    if not drive.by_voltage:
        return Envelope("coil", -most, most, limits.current_rate_A_s, math.inf, math.inf, sense, limits)
    volts = min(most, drive.winding.current_limit_A) * drive.winding.resistance_ohm
    return Envelope("coil", -volts, volts, math.inf, math.inf, math.inf, sense, limits)


def _inner_mass(drive: Drive, limits: Limits) -> Envelope:
    return Envelope("vibro", 0.0, abs(drive.command_unit), math.inf, math.inf, math.inf, 1.0, limits)


@dataclass(frozen=True)
class Driven:
    """One drive: its `envelope` from the limits, and the `actuator` by which a body is pushed; None where an inner mass
    is driven, which cycles move and no force on the body.
    """

    envelope: Callable[[Any, Limits], Envelope]
    actuator: type[Actuator] | None = None


DRIVES: Final[dict[str, Driven]] = {
    "magnetic": Driven(_carriage, CarriageActuator),
    "coil": Driven(_coil, CoilActuator),
    "vibro": Driven(_inner_mass),
}
"""The drives that can be led, by the name of their kind of rig."""


def bodies() -> tuple[str, ...]:
    """The drives that push a body directly."""
    return tuple(name for name, driven in DRIVES.items() if driven.actuator is not None)


def envelope_of(drive: Drive, limits: Limits | None = None) -> Envelope:
    """`limits` (the default ones where None) in the unit of `drive`'s command.

    Carriage: position within `travel_m`, and the gap at which the magnet pulls `force_N`, at most `gap_share`
    of that of the greatest pull. Coil: current within `current_A` and `force_N/k`, or the voltage that holds it. Inner
    mass: a switch from 0 to the rated command; what it puts on the tissue is the body's friction, which `force_N` does
    not reach. Raises ValueError for a drive without a command to limit.
    """
    if drive.name not in DRIVES:
        *others, last = DRIVES
        raise ValueError(f"drive must be {', '.join(others)} or {last} to be limited; got {drive.name!r}")
    return DRIVES[drive.name].envelope(drive, Limits() if limits is None else limits)


def actuator_of(drive: Drive, p: Numbers, envelope: Envelope) -> Actuator:
    """The static inverse of `drive` at `p`. Raises ValueError for a drive that pushes no body."""
    actuator = DRIVES[drive.name].actuator if drive.name in DRIVES else None
    if actuator is None:
        raise ValueError(f"drive must be {' or '.join(bodies())} for a PID on the force; got {drive.name!r}")
    return actuator(drive, p, envelope)


def friction_command(model: ControlModel, envelope: Envelope) -> float:
    """The command that overcomes a coil's mean friction; inf for other drives, which have a place or push no body."""
    if envelope.placed or model.drive.name not in bodies():
        return math.inf
    p = model.theta.base
    return max(abs(actuator_of(model.drive, p, envelope).command(mean_friction(model), 0.0, 0.0)), 1e-9)
