"""Noise that is not white: a sensor that filters."""

from __future__ import annotations

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.instrument.outliers import without_outliers
from models.checks.instrument.tones import tones
from models.checks.view import View, runs_of

_SETTLED_S = 0.3  # after a motion, in which a wall may still draw back
_WINDOW = 40  # samples whose slow course is taken out
_LEAST = 10  # windows
_CORRELATED = 0.3
_SURE = 5.0  # standard errors


def neighbours_correlation(view: View) -> tuple[float, int]:
    """Correlation of neighbouring samples of the measured column at rest, without its tones and what a parabola over 40
    samples follows, and the number of samples that it rests on; 0 of 0 where there is too little rest.
    """
    view, after = View(without_outliers(view), view.rig), round(_SETTLED_S / view.dt)
    windows = [
        view.y[k : k + _WINDOW]
        for a, b in runs_of(view.rests)
        for k in range(a + after, b - _WINDOW + 1, _WINDOW)
        if view.timed
    ]
    if len(windows) < _LEAST:
        return 0.0, 0
    rows = np.array(windows)
    at = np.arange(_WINDOW)
    waves = [turned(2 * np.pi * hertz * view.dt * at) for hertz, _ in tones(view) for turned in (np.sin, np.cos)]
    basis, _ = np.linalg.qr(np.column_stack([np.vander(at, 3).astype(float), *waves]))
    left = rows - rows @ basis @ basis.T
    power = float(np.sum(left**2))
    if power <= 0:
        return 0.0, 0
    lost = basis.shape[1] / _WINDOW  # white noise less what a basis follows is correlated by about minus this
    return float(np.sum(left[:, 1:] * left[:, :-1])) / power + lost, rows.size


def check_colour(view: View) -> list[RecordFinding]:
    """Noise of the measured column that goes on from sample to sample."""
    if not view.timed or view.noise == 0:
        return []
    correlation, count = neighbours_correlation(view)
    if count == 0 or correlation < max(_CORRELATED, _SURE / np.sqrt(count)):
        return []
    return [
        view.finding(
            "noise_coloured",
            "note",
            f"{view.measured}, at rest",
            f"the noise of {view.measured} goes on from sample to sample (correlation {correlation:.2f}): the sensor or"
            " its amplifier filters; a filter's delay looks like a late sensor",
            f"correlation of neighbours over {count} samples at rest",
            "log the sensor unfiltered, or state its delay: [clock] offset_s",
        )
    ]
