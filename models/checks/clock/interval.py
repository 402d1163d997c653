"""Samples so far apart, or so close, or a record so short, that the time is in another unit."""

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.settings import SET
from models.checks.view import View
from models.rigs.columns import TIME


def check_interval(view: View) -> list[RecordFinding]:
    """The usual interval between stamps, and what they span, against what a record may have."""
    if not view.timed:
        return []
    usual = float(np.median(np.abs(np.diff(view.t))))
    if usual == 0 or SET.step_s[0] <= usual <= SET.step_s[1]:
        return _short(view)
    least = usual < SET.step_s[0]
    return [
        view.finding(
            "time_units",
            "stops",
            "t_s, throughout",
            f"t_s must step by {'at least' if least else 'at most'} {SET.step_s[not least]:g} s;"
            f" got steps of {usual:g} s: is it in s?",
            "interval between stamps",
            f"{view.unit_line(TIME)}",
        )
    ]


def _short(view: View) -> list[RecordFinding]:
    span = float(np.ptp(view.t))
    if span >= SET.record_s:
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
