"""Samples so far apart, or so close, or a record so short, that the time is in another unit."""

from __future__ import annotations

from typing import Final

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.view import View
from models.rigs.columns import TIME

STEPS_S: Final = (1e-6, 1.0)
"""Least and most usual interval between samples of a record."""
_SHORTEST_S: Final = 0.2


def check_interval(view: View) -> list[RecordFinding]:
    """The usual interval between stamps, and what they span, against what a record may have."""
    if not view.timed:
        return []
    usual = float(np.median(np.abs(np.diff(view.t))))
    if usual == 0 or STEPS_S[0] <= usual <= STEPS_S[1]:
        return _short(view)
    least = usual < STEPS_S[0]
    return [
        view.finding(
            "time_units",
            "stops",
            "t_s, throughout",
            f"t_s must step by {'at least' if least else 'at most'} {STEPS_S[not least]:g} s; got steps of {usual:g} s:"
            " is it in s?",
            "interval between stamps",
            f"{view.unit_line(TIME)}",
        )
    ]


def _short(view: View) -> list[RecordFinding]:
    span = float(np.ptp(view.t))
    if span >= _SHORTEST_S:
        return []
    return [
        view.finding(
            "time_units",
            "weakens",
            "t_s, throughout",
            f"the record lasts {span:.3g} s ({len(view.t)} samples {view.dt:.3g} s apart): is t_s in s?",
            "time from the first stamp to the last",
            f"{view.unit_line(TIME)}, or longer records",
        )
    ]
