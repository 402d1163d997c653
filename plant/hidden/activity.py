"""Which groups of hidden effects a rig has: the compiled steps skip the others."""

from __future__ import annotations

from typing import Final

from plant.compiling import compiled
from plant.hidden.registry import ROWS
from plant.tables import Floats

_LEVEL: Final = (ROWS["stribeck"], ROWS["rolling_wobble"] + 1)
_FORCE: Final = (ROWS["viscous_drag"], ROWS["stress_relaxation"] + 1)
_DRIVE: Final = (ROWS["coupling_decay"], ROWS["back_emf"] + 1)
_STRING: Final = ROWS["string_compliance"]


@compiled
def _any(h: Floats, rows: tuple[int, int]) -> bool:
    found = False
    for row in range(rows[0], rows[1]):
        found = found or h[row, 0] != 0.0
    return found


@compiled
def has_level(h: Floats) -> bool:
    """Whether the table `h` holds an effect on the level of resistance."""
    return _any(h, _LEVEL)


@compiled
def has_force(h: Floats) -> bool:
    """Whether it holds a hidden force on the body."""
    return _any(h, _FORCE)


@compiled
def has_drive(h: Floats) -> bool:
    """Whether it holds an effect between drive and body."""
    return _any(h, _DRIVE) or h[_STRING, 0] != 0.0
