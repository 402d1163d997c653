"""The noise as it is against the noise as stated, and whether it is white."""

import math

import numpy as np
from annotated_types import Ge

from models.checks.finding import RecordFinding
from models.checks.instrument.usable import usable
from models.checks.settings import SET
from models.checks.view import Array, View, grid_step, spectral_noise, white_noise
from models.rigs.rig import Rig
from models.rigs.schema import bounds
from models.rigs.tables import Noise

_STATED = {"force_N": "force_std_N", "position_m": "position_std_m", "torque_N_m": "torque_std_N_m"}
_HOW = ("second differences in the quieter stretches", "the quietest tenth of the spectrum")


def stated_noise(rig: Rig, measured: str) -> tuple[str, float] | None:
    """Key and value with which the rig file states the noise of `measured`; None where it does not."""
    key = _STATED.get(measured)
    value = getattr(rig.noise, key) if key else None
    return None if key is None or value is None else (key, float(value))


def told_noise(y: Array, vibrates: bool, stated: float | None) -> float:
    """Standard deviation of the noise of a column's values `y` (n,) as they tell it themselves: in the quieter of its
    stretches (slip events only add), where the rig `vibrates` in the quieter part of the spectrum, or as `stated` where
    there is none; and at least what its resolution makes.
    """
    if vibrates:
        std, shown = spectral_noise(y)
        return max(std if shown or stated is None else min(std, stated), grid_step(y) / math.sqrt(12))
    pieces = np.array_split(y, max(1, min(40, len(y) // 100)))
    step = grid_step(y)
    quiet = float(np.percentile([white_noise(piece) for piece in pieces], 40))
    if step > 0.5 * quiet:  # a median of steps is a step
        quiet = float(np.percentile([_mean_noise(piece) for piece in pieces], 40))
    return max(quiet, step / math.sqrt(12))


def _mean_noise(x: Array) -> float:
    return float(np.mean(np.abs(np.diff(x, 2)))) * math.sqrt(math.pi / 12) if len(x) > 2 else 0.0


def noise_used(stated: float | None, told: float, span: float, step: float = 0.0) -> float:
    """The noise that fits use: the stated one with what a resolution `step` adds, unless the record is noisier or the
    stated one is absurd beside the `span` of the signal.
    """
    stated = stated if stated is None else math.hypot(stated, step / math.sqrt(12))
    if stated is None or told > SET.noise_off * stated or stated > SET.noise_absurd * span:
        return told
    return stated


def check_noise(view: View) -> list[RecordFinding]:
    """Noise that is not as the rig file states, or not white."""
    if not view.timed or len(view.y) < 200:
        return []
    found, unit, stated = [], view.unit, stated_noise(view.rig, view.measured)
    told = told_noise(view.y[usable(view)], view.kind.vibrates, stated[1] if stated else None)
    if stated is not None and told > SET.noise_off * stated[1]:
        found.append(
            view.finding(
                "noise_stated",
                "note",
                f"{view.measured}, throughout",
                f"the noise of {view.measured} is {told:.3g} {unit}, {told / stated[1]:.2g} times the stated"
                f" {stated[1]:.3g} {unit}; the fits use what was found",
                _HOW[view.kind.vibrates],
                _stated(stated[0], told),
            )
        )
    elif stated is not None and stated[1] > SET.noise_absurd * float(np.ptp(view.y)):
        found.append(
            view.finding(
                "noise_stated",
                "weakens",
                f"{view.measured}, throughout",
                f"the stated noise of {stated[1]:.3g} {unit} is as large as the signal itself, which spans"
                f" {float(np.ptp(view.y)):.3g} {unit}; the fits use {told:.3g} {unit}, which was found",
                "the stated noise beside the span of the column",
                _stated(stated[0], told),
            )
        )
    elif stated is not None and told < stated[1] / (2 * SET.noise_off):
        found.append(
            view.finding(
                "noise_stated",
                "note",
                f"{view.measured}, throughout",
                f"white noise of {view.measured} is {told:.3g} {unit}, less than the stated {stated[1]:.3g} {unit}: it"
                " is filtered, or better than its data sheet; the stated one is used",
                _HOW[view.kind.vibrates],
                f"{_stated(stated[0], told)}, where the sensor is that good",
            )
        )
    return found


def _stated(key: str, std: float) -> str:
    """What to write under `[noise]`, which a rig file takes."""
    lower, _ = bounds(Noise, key)
    small = isinstance(lower, Ge) and std < lower.ge  # type: ignore[operator]
    return f"leave {key} out of [noise]" if small else f"[noise] {key} = {std:.2g}"
