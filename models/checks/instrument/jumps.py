"""A measured place that goes elsewhere from one sample to the next, faster than anything could move the capsule."""

import numpy as np
from numpy.typing import NDArray

from models.checks.finding import RecordFinding
from models.checks.instrument.held_values import fresh
from models.checks.instrument.silence import silent
from models.checks.settings import SET
from models.checks.view import View


def jumps(view: View) -> NDArray[np.int64]:
    """Rows of the measured place before which it jumps and stays, (k,): by more than its noise and than 1 N could move
    the capsule in a sampling interval.
    """
    none = np.zeros(0, dtype=np.int64)
    if not view.timed or view.measured != "position_m" or len(view.y) < 4 * SET.beside or view.rig.capsule is None:
        return none
    interval = view.dt / float(np.mean(fresh(view)))
    least = max(SET.jump_noises * view.noise, SET.jump_force_N / view.rig.capsule.mass_kg * interval**2)
    step = np.diff(view.y)
    size = np.abs(step)
    beside = np.maximum(np.concatenate([[0.0], size[:-1]]), np.concatenate([size[1:], [0.0]]))
    rows = np.flatnonzero((size > least) & (beside < SET.jump_alone * size)) + 1
    rows = rows[(rows >= SET.beside) & (rows <= len(view.y) - SET.beside)]
    rows = rows[~silent(view)[rows - 2]]  # where a sensor comes back, its place is another
    left = [abs(np.median(view.y[k : k + SET.beside]) - np.median(view.y[k - SET.beside : k])) for k in rows]
    rows = rows[np.array(left) > SET.jump_stays * size[rows - 1]]
    return rows if len(rows) <= SET.jump_most else none


def check_jumps(view: View) -> list[RecordFinding]:
    """Jumps of the measured place."""
    rows = jumps(view)
    if not len(rows):
        return []
    largest = float(np.max(np.abs(np.diff(view.y)[rows - 1])))
    return [
        view.finding(
            "place_jumps",
            "weakens",
            f"{view.measured}, {view.at(rows)}",
            f"{view.measured} jumps {'once' if len(rows) == 1 else f'{len(rows)} times'}, by up to"
            f" {view.told(largest)}, from one sample to the next and stays there: the localisation lost its place"
            " or its zero was set anew",
            f"further than {SET.jump_force_N:g} N could move the capsule in a sampling interval",
            "cut the file there into two records",
        )
    ]
