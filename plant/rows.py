"""One recorded row: time, state, force and drive of a moment."""

from plant import layout as at
from plant.compiling import compiled
from plant.tables import Floats


@compiled
def write_row(row: Floats, t: float, s: Floats, force: float, drive: float) -> None:
    """Fill `row` in the columns of `plant.layout`, from the state `s` as it is at time `t` in s."""
    row[at.O_T] = t
    row[at.O_X] = s[at.S_X]
    row[at.O_V] = s[at.S_V]
    row[at.O_U] = s[at.S_U]
    row[at.O_FORCE] = force
    row[at.O_DRIVE] = drive
    row[at.O_CURRENT] = s[at.S_CURRENT]
    row[at.O_INNER_X] = s[at.S_INNER_X]
    row[at.O_INNER_V] = s[at.S_INNER_V]
