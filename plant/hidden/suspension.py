"""Hidden effects on the inner mass of a vibro drive: damping of its spring and stops that nobody mentioned."""

from __future__ import annotations

from typing import Final

from plant.compiling import compiled
from plant.hidden.registry import ROWS
from plant.tables import Floats

DAMPING: Final = ROWS["spring_damping"]
STOPS: Final = ROWS["end_stop_impact"]
_LOSS = 1.5  # s/m, Hunt-Crossley damping of the hidden stops


@compiled
def suspension_force(r: float, rate: float, h: Floats) -> float:
    """Force in N that the hidden suspension puts on the inner mass against its offset `r` in m and `r'` in m/s, positive
    inwards.
    """
    force = 0.0
    if h[DAMPING, 0] != 0.0:
        force += h[DAMPING, 0] * rate * (1 + 2.0 * abs(rate))
    if h[STOPS, 0] != 0.0:
        if r > h[STOPS, 0]:
            force += max(h[STOPS, 1] * (r - h[STOPS, 0]) * (1 + _LOSS * rate), 0.0)
        elif r < -h[STOPS, 0]:
            force += min(h[STOPS, 1] * (r + h[STOPS, 0]) * (1 - _LOSS * rate), 0.0)
    return force
