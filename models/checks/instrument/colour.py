"""Noise that is not white: a sensor that filters."""

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.instrument.outliers import without_outliers
from models.checks.instrument.tones import tones
from models.checks.settings import SET
from models.checks.view import Array, View


def _correlation(view: View, rows: Array) -> float:
    """Correlation of neighbouring samples of `rows` (n, m) without the record's tones and what a parabola follows."""
    at = np.arange(rows.shape[1])
    waves = [turned(2 * np.pi * hertz * view.dt * at) for hertz, _ in tones(view) for turned in (np.sin, np.cos)]
    basis, _ = np.linalg.qr(np.column_stack([np.vander(at, 3).astype(float), *waves]))
    left = rows - rows @ basis @ basis.T
    power = float(np.sum(left**2))
    lost = basis.shape[1] / len(at)  # white noise less what a basis follows is correlated by about minus this
    return float(np.sum(left[:, 1:] * left[:, :-1])) / power + lost if power > 0 else 0.0


def check_colour(view: View) -> list[RecordFinding]:
    """Noise of the measured column that goes on from sample to sample."""
    if not view.timed or view.noise == 0:
        return []
    view = View(without_outliers(view), view.rig)
    told = ((view.windows_at_rest(samples), fewest, least) for samples, fewest, least in SET.colour_windows)
    rows, least = next(((rows, least) for rows, fewest, least in told if len(rows) >= fewest), (np.zeros((0, 1)), 0.0))
    if not rows.size or (correlation := _correlation(view, rows)) < max(least, SET.colour_sure / np.sqrt(rows.size)):
        return []
    return [
        view.finding(
            "noise_coloured",
            "note",
            f"{view.measured}, at rest",
            f"the noise of {view.measured} goes on from sample to sample (correlation {correlation:.2f}): the sensor or"
            " its amplifier filters; a filter's delay looks like a late sensor",
            f"correlation of neighbours over {rows.size} samples at rest",
            "log the sensor unfiltered, or state its delay: [clock] offset_s",
        )
    ]
