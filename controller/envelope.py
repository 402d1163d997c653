"""What the limits mean for the command of one drive."""

from __future__ import annotations

import math

from controller.limits import Envelope, Limits
from models.drives.coil import Coil, VoltageCoil
from models.drives.drive import Drive
from models.drives.magnetic import Magnetic
from models.drives.vibro import Vibro


def envelope_of(drive: Drive, limits: Limits | None = None) -> Envelope:
    """`limits` (the default ones where None) in the unit of `drive`'s command.

    Carriage: position within `travel_m`, and the gap at which the magnet pulls `force_N`, at most `gap_share
    r/sqrt(3)`. Coil: current within `current_A` and `force_N/k`, or the voltage that holds it. Inner mass: a switch
    from 0 to the rated command; what it puts on the tissue is the body's friction, which `force_N` does not reach.
    Raises ValueError for a drive without a command to limit.
    """
    limits = Limits() if limits is None else limits
    if isinstance(drive, Magnetic):
        return _carriage(drive, limits)
    if isinstance(drive, Coil):
        return _coil(drive, limits)
    if isinstance(drive, Vibro):
        return Envelope("vibro", 0.0, abs(drive.command_unit), math.inf, math.inf, math.inf, 1.0, limits)
    raise ValueError(f"drive must be magnetic, coil or vibro to be limited; got {drive.name!r}")


def _carriage(drive: Magnetic, limits: Limits) -> Envelope:
    gap = gap_of_force(limits.force_N, drive, limits.gap_share * drive.range_m / math.sqrt(3))
    speed, acceleration = limits.carriage_speed_m_s, limits.carriage_acceleration_m_s2
    return Envelope("magnetic", -limits.travel_m, limits.travel_m, speed, acceleration, gap, 1.0, limits)


def _coil(drive: Coil, limits: Limits) -> Envelope:
    gain = drive.force_constant_N_per_A
    most = limits.current_A if gain == 0 else min(limits.current_A, limits.force_N / abs(gain))
    sense = math.copysign(1.0, gain)
    if not isinstance(drive, VoltageCoil):
        return Envelope("coil", -most, most, limits.current_rate_A_s, math.inf, math.inf, sense, limits)
    volts = min(most, drive.winding.current_limit_A) * drive.winding.resistance_ohm
    return Envelope("coil", -volts, volts, math.inf, math.inf, math.inf, sense, limits)


def gap_of_force(force: float, drive: Magnetic, most: float) -> float:
    """The gap in m up to `most` <= r/sqrt(3) at which the magnet pulls `force` in N; `most` where it never does."""

    def pull(gap: float) -> float:
        return drive.stiffness_N_per_m * gap / (1 + (gap / drive.range_m) ** 2) ** 2

    if pull(most) <= force:
        return most
    low, high = 0.0, most
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if pull(middle) <= force else (low, middle)
    return low
