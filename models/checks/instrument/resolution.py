"""Resolution against noise: a converter or a camera whose steps are wider than the noise."""

from __future__ import annotations

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.view import View, grid_step

_COARSE = 2.0  # steps wider than this many standard deviations of the noise
_FEW_LEVELS = 25


def check_resolution(view: View) -> list[RecordFinding]:
    """Values of the measured column on a grid that is coarse beside the noise."""
    if not view.timed:
        return []
    step = grid_step(view.y)
    if step == 0 or step <= _COARSE * view.noise or (view.noise == 0 and np.mean(np.diff(view.y) == 0) < 0.3):
        return []
    levels = round(float(np.ptp(view.y)) / step) + 1
    unit = view.unit
    key = {"N": "force_std_N", "m": "position_std_m", "N m": "torque_std_N_m"}.get(unit)
    value = step / np.sqrt(12)
    return [
        view.finding(
            "resolution",
            "weakens" if levels < _FEW_LEVELS else "note",
            f"{view.measured}, throughout",
            f"{view.measured} has a resolution of {step:.3g} {unit}, {levels} levels over its range: coarser than its"
            f" noise, so the noise counts as at least {value:.2g} {unit}",
            "all values lie on one grid",
            f"[noise] {key} = {value:.2g}" if key else "record with a finer resolution",
        )
    ]
