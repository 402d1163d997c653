"""Resolution against noise: a converter or a camera whose steps are wider than the noise."""

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.settings import SET
from models.checks.view import Array, View, grid_step, running_mean

PLACES = ("position_m", "carriage_position_m", "angle_rad")
"""Driven columns that say where something is."""


def _half_step(view: View, x: Array) -> int:
    """Half the samples that a step of the place `x` lasts at the usual speed; 0 where it has no such steps."""
    step = grid_step(x)
    speed = float(np.median(np.abs(view.speed[view.moves]))) if view.moves.any() else 0.0
    if step == 0 or speed == 0 or step <= SET.step_wide * speed * view.dt:
        return 0
    return max(1, round(0.5 * min(step / speed, SET.step_longest_s) / view.dt))


def without_steps(view: View, x: Array) -> Array:
    """The place `x` (n,) over time without the steps of a coarse scale: a running mean as long as one lasts; `x` itself
    where it has none.
    """
    half = _half_step(view, x)
    return running_mean(x, half) if half else x


def check_driven_resolution(view: View) -> list[RecordFinding]:
    """A driven place that goes in steps."""
    if not view.timed or view.driven is None or view.driven not in PLACES:
        return []
    half = _half_step(view, view.record[view.driven])
    if not half:
        return []
    return [
        view.finding(
            "driven_resolution",
            "weakens" if view.kind.drawn else "note",
            f"{view.driven}, throughout",
            f"{view.driven} goes in steps of {view.told(grid_step(view.record[view.driven]))}, each"
            f" {1e3 * 2 * half * view.dt:.3g} ms long at the usual speed; fits take a running mean of that length"
            + ("; the wall's force changes within less than such a step" if view.kind.drawn else ""),
            "all values lie on one grid",
            "log the command or a finer encoder",
        )
    ]


def check_resolution(view: View) -> list[RecordFinding]:
    """Values of the measured column on a grid that is coarse beside the noise."""
    if not view.timed:
        return []
    step = grid_step(view.y)
    if (
        step == 0
        or step <= SET.coarse * view.noise
        or (view.noise == 0 and np.mean(np.diff(view.y) == 0) < SET.coarse_equal)
    ):
        return []
    levels = round(float(np.ptp(view.y)) / step) + 1
    unit = view.unit
    key = {"N": "force_std_N", "m": "position_std_m", "N m": "torque_std_N_m"}.get(unit)
    value = step / np.sqrt(12)
    return [
        view.finding(
            "resolution",
            "weakens" if levels < SET.few_levels else "note",
            f"{view.measured}, throughout",
            f"{view.measured} has a resolution of {step:.3g} {unit}, {levels} levels over its range: coarser than its"
            f" noise, so the noise counts as at least {value:.2g} {unit}",
            "all values lie on one grid",
            f"[noise] {key} = {value:.2g}" if key else "record with a finer resolution",
        )
    ]
