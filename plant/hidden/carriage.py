"""Hidden effects between the commanded and the real drive: a cascade of lags and a play with rounded ends."""

from typing import Final

from plant.compiling import compiled
from plant.hidden.registry import LAG_SHARES, ROW
from plant.tables import Floats

BEHIND: Final = [ROW.actuator_lag, ROW.driver_lag, ROW.carriage_backlash]
"""Effects between the commanded and the real drive."""
CARRIAGE_NUMBERS: Final = 2 + len(LAG_SHARES)  # of the memory: two of the play, one a lag


@compiled
def lags(values: Floats, dt: float, time: float, memory: Floats) -> None:
    """Lags in a row of `values`, one a step of `dt` s, in place; see `real_drive`."""
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
    """What arrives of the commanded drive `values`, one a step of `dt` s: lags in a row, then play of width `a`. In the
    play the carriage follows with the third power of the distance to its end. `memory` (`CARRIAGE_NUMBERS`, the first
    values at rest) carries over from call to call and is changed in place.
    """
    arrived = values.copy()
    time = h[ROW.actuator_lag, 0] + h[ROW.driver_lag, 0]  # a drive has one of them
    if time != 0.0:
        lags(arrived, dt, time, memory)
    if h[ROW.carriage_backlash, 0] != 0.0:
        rounded_play(arrived, h[ROW.carriage_backlash, 0], memory)
    return arrived
