"""Stretches in which a noisy sensor has no noise: it was lost, and its values are held or filled in."""

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.instrument.clipping import clipped
from models.checks.settings import SET
from models.checks.view import Mask, View, runs_of


def silent(view: View) -> Mask:
    """Where the measured column lies on one value or one straight line for longer than its noise lets it; nowhere in a
    column without noise. Shape of the column.
    """
    mask = np.zeros(len(view.y), dtype=bool)
    if not view.timed or len(view.y) < 10 * SET.silence_samples:
        return mask
    second = np.diff(view.y, 2)
    usual = float(np.median(np.abs(second)))
    still = np.abs(second) <= SET.silent * usual
    runs = [(a, b) for a, b in runs_of(still) if b - a >= max(SET.silence_samples, round(SET.silence_s / view.dt))]
    if usual == 0 or not runs:
        return mask
    for a, b in runs:
        mask[a : b + 2] = True
    rest = ~mask[1:-1]
    pairs = rest[1:] & rest[:-1] & (np.maximum(np.abs(second[1:]), np.abs(second[:-1])) < 5 * usual)
    power = float(np.sum(second[:-1][pairs] ** 2))
    share = float(np.mean(still[rest])) if rest.any() else 1.0
    noisy = power > 0 and float(second[1:][pairs] @ second[:-1][pairs]) < SET.silence_noisy * power
    if not noisy or len(mask) * share**SET.silence_samples > SET.silence_chance:
        mask[:] = False
    return mask & ~clipped(view)


def check_silence(view: View) -> list[RecordFinding]:
    """A measured column whose noise is gone for a while."""
    mask = silent(view)
    if not mask.any():
        return []
    lost = runs_of(mask)
    longest = max((b - a) * view.dt for a, b in lost)
    times = "once" if len(lost) == 1 else f"{len(lost)} times"
    return [
        view.finding(
            "sensor_silent",
            "weakens" if mask.mean() > SET.silence_much else "note",
            f"{view.measured}, {view.at([a for a, _ in lost])}",
            f"{view.measured} keeps one value or follows a straight line {times}, for up to {longest:.3g} s, without"
            " the noise that it has elsewhere: the sensor was lost and its values are held or filled in; they are left"
            " out of every fit",
            f"second differences below 0.1 % of the usual ones for {SET.silence_samples} samples and more",
            "leave out what was not measured; look at cable, connector and line of sight",
        )
    ]
