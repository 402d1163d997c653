"""Values that pile up at the end of a range: an amplifier or a converter that clips."""

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.settings import SET
from models.checks.view import Mask, View, grid_step, runs_of


def clipped(view: View) -> Mask:
    """Where the measured column stands at an end of its range as clipping leaves it, shape of the column. Needs noise:
    without it rest at the end of a stroke looks the same.
    """
    y, mask = view.y, np.zeros(len(view.y), dtype=bool)
    step = grid_step(y)
    if not view.timed or np.ptp(y) == 0 or view.noise <= max(SET.clip_dither * step, 1e-7 * float(np.ptp(y))):
        return mask
    for end in (float(y.max()), float(y.min())):
        at = np.abs(y - end) <= max(0.5 * step, 1e-9 * float(np.ptp(y)))
        runs = np.array([b - a for a, b in runs_of(at)])
        rest = y[~at]
        usual = len(rest) / max(1, int(np.sum(np.diff(rest) != 0)) + 1)
        if (
            at.mean() > SET.clip_share
            and np.sum(runs >= SET.clip_run) >= SET.clips
            and runs.mean() > SET.clip_long * usual / 2
        ):
            mask |= at
    return mask


def check_clipping(view: View) -> list[RecordFinding]:
    """Clipping or saturation of the measured column."""
    where = clipped(view)
    if not where.any():
        return []
    ends = np.unique(view.y[where][[int(np.argmin(view.y[where])), int(np.argmax(view.y[where]))]])
    unit = view.measured.rsplit("_", 1)[1]
    limits = " and ".join(f"{end:.4g} {unit}" for end in ends)
    return [
        view.finding(
            "clipping",
            "weakens",
            f"{view.measured}, {view.at(np.flatnonzero(where))}",
            f"{100 * where.mean():.1f} % of {view.measured} stand exactly at {limits}: the sensor or its amplifier"
            " clips there; these samples are left out of every fit",
            "several runs of equal values at the end of the range, many more than next to it",
            "record again with a smaller gain (a larger range of the amplifier)",
        )
    ]
