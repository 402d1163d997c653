"""A record that begins in the middle of a motion."""

from __future__ import annotations

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.view import View


def check_start(view: View) -> list[RecordFinding]:
    """Whether the motion is on when the record starts; predictions start at rest."""
    if not view.timed or view.kind in ("axis", "vibro") or not view.moves.any():
        return []
    first = max(2, round(0.1 / view.dt))
    usual = float(np.median(np.abs(view.speed[view.moves])))
    if not view.moves[:first].all() or abs(float(np.mean(view.speed[:first]))) < 0.5 * usual:
        return []
    return [
        view.finding(
            "starts_in_motion",
            "note",
            f"{view.moving_column}, {view.at([0])}",
            f"the record starts in motion at {1e3 * float(np.mean(view.speed[:first])):.3g} mm/s; predictions start at"
            " rest, so its first moments are predicted wrongly",
            "speed over the first tenth of a second",
            "record from half a second before the motion starts",
        )
    ]
