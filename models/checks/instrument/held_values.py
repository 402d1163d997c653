"""Values that are held: a slow sensor logged at a faster rate."""

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.instrument.clipping import clipped
from models.checks.settings import SET
from models.checks.view import Mask, View, grid_step


def fresh(view: View) -> Mask:
    """Where a value of the measured column is a new one, shape of the column; everywhere where none are held."""
    y = view.y
    every = np.ones(len(y), dtype=bool)
    if not view.timed or len(y) < 20:
        return every
    changes = np.flatnonzero(np.concatenate([[True], np.diff(y) != 0]))
    if len(changes) > (1 - SET.held_share) * len(y) or len(changes) < 10:
        return every
    step = grid_step(y)
    if step and np.median(np.abs(np.diff(y[changes]))) < 1.5 * step:  # the next step of a coarse scale, not a new value
        return every
    lengths = np.diff(changes)
    usual = float(np.median(lengths))
    if usual < 2 or np.mean(np.abs(lengths - usual) <= max(1.0, 0.1 * usual)) < SET.held_regular:
        return every
    mask = np.zeros(len(y), dtype=bool)
    mask[changes] = True
    long = changes[:-1][lengths > SET.held_again * usual]  # the same value measured again
    for first, length in zip(long, lengths[lengths > SET.held_again * usual], strict=True):
        mask[np.round(np.arange(first, first + length - 0.5 * usual, usual)).astype(int)] = True
    return mask


def check_held_values(view: View) -> list[RecordFinding]:
    """A measured column that holds its values for several samples."""
    new = fresh(view)
    if new.all() or clipped(view).mean() > SET.held_clipped:
        return []
    rate, true = 1 / view.dt, float(new.mean()) / view.dt
    return [
        view.finding(
            "held_values",
            "note",
            f"{view.measured}, throughout",
            f"{view.measured} is logged {rate:.4g} times a second but changes {true:.3g} times a second: values are"
            " held in between; only the new ones are used",
            f"runs of {1 / new.mean():.3g} equal values on average, of one length",
            "log the sensor at its own rate with its own time stamps",
        )
    ]
