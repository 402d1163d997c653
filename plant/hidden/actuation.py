"""Hidden effects of the drive: lag and play of the carriage, grip, saturation, memory, dead zone, sideways load."""

import math
from typing import Final

from plant.compiling import compiled
from plant.hidden.registry import LAG_SHARES, ONSET, ROW
from plant.layout import S_DRIVE_LAST, S_HYSTERESIS
from plant.tables import Floats

BEHIND: Final = [ROW.actuator_lag, ROW.driver_lag, ROW.carriage_backlash]
"""Effects between the commanded and the real drive."""
CARRIAGE_NUMBERS: Final = 2 + len(LAG_SHARES)  # of the memory: two of the play, one a lag


@compiled
def lags(values: Floats, dt: float, time: float, memory: Floats) -> None:
    """Lags in series on `values`, one per step of `dt` s, in place; see `real_drive`."""
    for k in range(values.shape[0]):
        value = values[k]
        for i in range(len(LAG_SHARES)):
            memory[2 + i] += dt / (LAG_SHARES[i] * time + dt) * (value - memory[2 + i])
            value = memory[2 + i]
        values[k] = value


@compiled
def rounded_play(values: Floats, width: float, memory: Floats) -> None:
    """The play of `values` within `width`, in place; see `real_drive`."""
    for k in range(values.shape[0]):
        change = values[k] - memory[1]
        memory[1] = values[k]
        ahead = (values[k] - memory[0]) / width if change > 0 else (memory[0] - values[k]) / width
        memory[0] += change * min(max(0.5 + ahead, 0.0), 1.0) ** 3
        values[k] = memory[0]


def real_drive(values: Floats, dt: float, h: Floats, memory: Floats) -> Floats:
    """The real drive for the commanded `values`, one per step of `dt` s: lags in series, then play of width `a`, in
    which the carriage follows with the third power of the distance to its end. `memory` (`CARRIAGE_NUMBERS`, initially
    the first values at rest) carries over between calls and changes in place.
    """
    arrived = values.copy()
    time = h[ROW.actuator_lag, 0] + h[ROW.driver_lag, 0]  # a drive has one of them
    if time != 0.0:
        lags(arrived, dt, time, memory)
    if h[ROW.carriage_backlash, 0] != 0.0:
        rounded_play(arrived, h[ROW.carriage_backlash, 0], memory)
    return arrived


@compiled
def coupling(x: float, t: float, h: Floats) -> float:
    """Factor on the drive's gain at position `x` in m and time `t` in s."""
    gain = 1.0
    if h[ROW.coupling_decay, 0] != 0.0:
        gain *= 1 - 0.5 * h[ROW.coupling_decay, 0] * (1 + math.tanh((x - 5e-3) / h[ROW.coupling_decay, 1]))
    if h[ROW.coupling_fade, 0] != 0.0:
        gain *= 1 - h[ROW.coupling_fade, 0] * (
            1 - math.exp((h[ROW.coupling_fade, ONSET] - t) / h[ROW.coupling_fade, 1])
        )
    return gain


@compiled
def delivered(force: float, s: Floats, h: Floats) -> float:
    """The drive's force in N after saturation, plus magnetic memory."""
    if h[ROW.actuator_saturation, 0] != 0.0:
        force /= (1 + abs(force / h[ROW.actuator_saturation, 0]) ** 3) ** (1.0 / 3.0)
    if h[ROW.magnetic_hysteresis, 0] != 0.0:
        force += h[ROW.magnetic_hysteresis, 0] * s[S_HYSTERESIS]
    return force


@compiled
def remember_drive(value: float, s: Floats, h: Floats) -> None:
    """Advance magnetic memory with the change of its input (gap in m, current in A)."""
    if h[ROW.magnetic_hysteresis, 0] != 0.0:
        change = value - s[S_DRIVE_LAST]
        z = s[S_HYSTERESIS]
        s[S_HYSTERESIS] = z + change / h[ROW.magnetic_hysteresis, 1] * (1 - math.copysign(z * abs(z), z * change))
    s[S_DRIVE_LAST] = value


@compiled
def effective_current(current: float, h: Floats) -> float:
    """Current in A that produces force: none below the dead zone, whose edge is rounded."""
    if h[ROW.actuator_dead_zone, 0] == 0.0:
        return current
    return float(current * (1 - 1 / (1 + (current / h[ROW.actuator_dead_zone, 0]) ** 4)))


@compiled
def hidden_emf(v: float, h: Floats) -> float:
    """Voltage in V of the hidden back-EMF."""
    return float(h[ROW.back_emf, 0] * v * (1 + abs(v) * 5.0))


@compiled
def sideways_load(gap: float, h: Floats) -> float:
    """Resistance in N from a magnet that presses the capsule down: `a (g/g_0)^2`."""
    if h[ROW.attraction_load, 0] == 0.0:
        return 0.0
    return float(h[ROW.attraction_load, 0] * (gap / h[ROW.attraction_load, 1]) ** 2)


@compiled
def dipole_load(gap: float, h: Floats) -> float:
    """Force in N with which a magnet presses the capsule down: `a (1 - 3/2 q)/(1 + q)^(7/2)`, at least 0."""
    if h[ROW.dipole_load, 0] == 0.0:
        return 0.0
    q = (gap / h[ROW.dipole_load, 1]) ** 2
    return float(h[ROW.dipole_load, 0] * max(1 - 1.5 * q, 0.0) / (1 + q) ** 3.5)


@compiled
def link_force(stretch: float, stiffness: float, h: Floats) -> float:
    """Force in N of the pull's link; a hidden string is softer and stiffens: `k e (1 + (e/e_0)^2)`."""
    if h[ROW.string_compliance, 0] == 0.0:
        return stiffness * stretch
    return float(stretch / h[ROW.string_compliance, 0] * (1 + (stretch / h[ROW.string_compliance, 1]) ** 2))
