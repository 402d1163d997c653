"""One recorded row: time, state, force and drive of a moment."""

from __future__ import annotations

from plant.compiling import compiled
from plant.layout import (
    O_CURRENT,
    O_DRIVE,
    O_FORCE,
    O_INNER_V,
    O_INNER_X,
    O_T,
    O_U,
    O_V,
    O_X,
    S_CURRENT,
    S_INNER_V,
    S_INNER_X,
    S_U,
    S_V,
    S_X,
)
from plant.tables import Floats


@compiled
def write_row(row: Floats, t: float, s: Floats, force: float, drive: float) -> None:
    """Fill `row` in the columns of `plant.layout`, from the state `s` as it is at time `t` in s."""
    row[O_T] = t
    row[O_X] = s[S_X]
    row[O_V] = s[S_V]
    row[O_U] = s[S_U]
    row[O_FORCE] = force
    row[O_DRIVE] = drive
    row[O_CURRENT] = s[S_CURRENT]
    row[O_INNER_X] = s[S_INNER_X]
    row[O_INNER_V] = s[S_INNER_V]
