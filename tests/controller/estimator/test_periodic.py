"""Folds elsewhere than in the model, or absent, are found while running; a right model stays as it is."""

import math

import numpy as np
import pytest

from hil.app.scenario.scenario import parse_track_scenario
from hil.app.track.loop import believed_model, run_loop
from models.theta import Theta
from plant import layout as at

LENGTH_M = 7.3e-3
SPEED_MM_S = 1.5
HERE = 0.4  # rad, of the model


def folds(depth: float) -> Theta:
    """The plant's folds in the catalogue's form."""
    numbers = {"depth": depth, "wavelength_m": LENGTH_M, "phase_rad": HERE}
    numbers |= {"second_sin": 0.35 * math.cos(0.8), "second_cos": 0.35 * math.sin(0.8)}
    return Theta.of((("fold_periodic", name), value) for name, value in numbers.items())


def late_mm(kind: str, phase_rad: float | None, values: Theta, seed: int = 1) -> float:
    """Tracking error, rms, from one wavelength and a half on, over folds at `phase_rad` (None: none)."""
    there = {"excess": 0.3, "wavelength_m": LENGTH_M, "phase_rad": phase_rad}
    scenario = parse_track_scenario(
        {
            "scenario": {"duration_s": 18.0},
            "rig": {"kind": kind},
            "tissue": {"preset": "jejunum", "friction_coefficient": 0.085, "hoop_stress_factor": 1.05},
            "localisation": {"std": 2e-4},
            "control": {"tick_s": 0.002},
            "reference": {"kind": "ramp", "speed_mm_s": SPEED_MM_S},
            "effects": {} if phase_rad is None else {"fold_periodic": there},
        }
    )
    trace = run_loop(scenario, believed_model(scenario, values), "feedforward", seed)
    t, x = trace.rows[:, at.O_T], trace.rows[:, at.O_X]
    error = (x - scenario.reference.position(t))[t > 0.5 + 1.5e3 * LENGTH_M / SPEED_MM_S]
    return 1e3 * float(np.sqrt(np.mean(error**2)))


@pytest.mark.parametrize("kind", ["magnetic", "coil"])
@pytest.mark.parametrize("off_rad", [math.pi, 0.5 * math.pi])
def test_folds_elsewhere_are_followed_within_a_wavelength(kind: str, off_rad: float) -> None:
    """Half a wavelength off, the error was twice that of the model without folds."""
    assert late_mm(kind, HERE + off_rad, folds(0.3)) < 0.8 * late_mm(kind, HERE + off_rad, Theta())


@pytest.mark.parametrize("kind", ["magnetic", "coil"])
def test_absent_folds_are_left_out_and_right_ones_stay(kind: str) -> None:
    """Absent, the error was ten times that of the model without folds. A few seeds of ten need longer to find that."""
    fixed, seeds = 0.35 * late_mm(kind, HERE, Theta()), (1, 2, 3)
    assert np.median([late_mm(kind, None, folds(0.3), seed) for seed in seeds]) < fixed
    right = [late_mm(kind, HERE, folds(0.3), seed) for seed in seeds]
    assert max(right) < fixed, "0.05 to 0.09 mm, in Python as in C"
