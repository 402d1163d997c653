"""Hidden effects between the commanded and the real drive: a cascade of lags and a play with rounded ends."""

from __future__ import annotations

from typing import Final

import numpy as np

from plant.compiling import compiled
from plant.hidden.registry import ROWS
from plant.tables import Floats

LAG: Final = ROWS["actuator_lag"]
BACKLASH: Final = ROWS["carriage_backlash"]


@compiled
def _two_lags(values: Floats, dt: float, time: float, memory: Floats) -> Floats:
    out = np.empty_like(values)
    share = dt / (0.5 * time + dt)
    for k in range(values.shape[0]):
        memory[0] += share * (values[k] - memory[0])
        memory[1] += share * (memory[0] - memory[1])
        out[k] = memory[1]
    return out


@compiled
def _rounded_play(values: Floats, width: float, memory: Floats) -> Floats:
    out = np.empty_like(values)
    for k in range(values.shape[0]):
        change = values[k] - memory[3]
        memory[3] = values[k]
        ahead = (values[k] - memory[2]) / width if change > 0 else (memory[2] - values[k]) / width
        memory[2] += change * min(max(0.5 + ahead, 0.0), 1.0) ** 3
        out[k] = memory[2]
    return out


def real_drive(values: Floats, dt: float, h: Floats, memory: Floats) -> Floats:
    """What arrives of the commanded drive `values`, one a step of `dt` s: `a/2` lags in a row, then play of width `a`.

    In the play the carriage follows with the third power of the distance to its end. `memory` (four numbers, the first
    values at rest) carries over from call to call and is changed in place.
    """
    if h[LAG, 0] != 0.0:
        values = _two_lags(values, dt, h[LAG, 0], memory)
    if h[BACKLASH, 0] != 0.0:
        values = _rounded_play(values, h[BACKLASH, 0], memory)
    return values
