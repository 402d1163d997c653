"""A record that begins in the middle of a motion."""

from __future__ import annotations

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.view import View

_SETTLED_M = 6e-3  # m, a way after which a dragged wall and a magnet's gap are what they are in motion
_WALL_SETTLED_M = 2e-3  # m, the same for the wall alone, where a rig holds the capsule
_MOST = 0.25  # of the record


def run_in(view: View) -> int:
    """How many rows of a record that starts in motion do not count; 0 for one that starts at rest."""
    if not view.timed or view.kind in ("axis", "vibro") or not view.moves.any():
        return 0
    first = max(2, round(0.1 / view.dt))
    usual = float(np.median(np.abs(view.speed[view.moves])))
    if not view.moves[:first].all() or abs(float(np.mean(view.speed[:first]))) < 0.5 * usual:
        return 0
    travelled = np.cumsum(np.abs(view.speed) * view.dt)
    way = _WALL_SETTLED_M if view.kind == "pull" else _SETTLED_M
    return min(int(np.searchsorted(travelled, way)), round(_MOST * len(travelled)))


def check_start(view: View) -> list[RecordFinding]:
    """Whether the motion is on when the record starts; predictions start at rest."""
    rows = run_in(view)
    if not rows:
        return []
    speed = float(np.mean(view.speed[: max(2, round(0.1 / view.dt))]))
    return [
        view.finding(
            "starts_in_motion",
            "note",
            f"{view.moving_column}, {view.at([0])}",
            f"the record starts in motion at {1e3 * speed:.3g} mm/s; predictions start at rest, so its first"
            f" {rows * view.dt:.3g} s count in no fit and no error",
            "speed over the first tenth of a second",
            "record from half a second before the motion starts",
        )
    ]
