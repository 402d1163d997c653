"""A measured place that goes elsewhere from one sample to the next, faster than anything could move the capsule."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from models.checks.finding import RecordFinding
from models.checks.instrument.held_values import fresh
from models.checks.instrument.silence import silent
from models.checks.view import View

_FORCE_N = 1.0  # N, twice the largest force that is allowed on tissue
_NOISES = 12.0
_ALONE = 0.25  # of a jump, the most by which the samples beside it move
_STAYS = 0.7  # of a jump, the least that remains over the following samples
_BESIDE = 10  # samples
_MOST = 20


def jumps(view: View) -> NDArray[np.int64]:
    """Rows of the measured place before which it jumps and stays, (k,): by more than its noise and than 1 N could move
    the capsule in a sampling interval.
    """
    none = np.zeros(0, dtype=np.int64)
    if not view.timed or view.measured != "position_m" or len(view.y) < 4 * _BESIDE or view.rig.capsule is None:
        return none
    interval = view.dt / float(np.mean(fresh(view)))
    least = max(_NOISES * view.noise, _FORCE_N / view.rig.capsule.mass_kg * interval**2)
    step = np.diff(view.y)
    size = np.abs(step)
    beside = np.maximum(np.concatenate([[0.0], size[:-1]]), np.concatenate([size[1:], [0.0]]))
    rows = np.flatnonzero((size > least) & (beside < _ALONE * size)) + 1
    rows = rows[(rows >= _BESIDE) & (rows <= len(view.y) - _BESIDE)]
    rows = rows[~silent(view)[rows - 2]]  # where a sensor comes back, its place is another
    left = [abs(np.median(view.y[k : k + _BESIDE]) - np.median(view.y[k - _BESIDE : k])) for k in rows]
    rows = rows[np.array(left) > _STAYS * size[rows - 1]]
    return rows if len(rows) <= _MOST else none


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
            f"further than {_FORCE_N:g} N could move the capsule in a sampling interval",
            "cut the file there into two records",
        )
    ]
