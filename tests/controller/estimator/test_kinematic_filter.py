"""The kinematic filter: unbiased on a ramp in spite of the delay, quieter than the sensor, outliers refused, blindness
told; who gets it.
"""

import math

import numpy as np
import pytest

from controller.estimator.base import Estimator
from controller.estimator.kinematic_filter import KinematicFilter
from controller.estimator.ukf import UnscentedEstimator
from controller.registry import estimator_for
from controller.signals import Measurement
from tests.controller.loops import model_of

MODEL = model_of()
LATE_S = 8e-3


def along_a_ramp(seconds: float, wild: float = 0.0) -> tuple[KinematicFilter, np.ndarray]:
    """The filter's error at 2 mm/s with 0.5 mm of noise at 100 Hz, 8 ms late; each 20th position off by `wild`."""
    rng, seen, off = np.random.default_rng(0), KinematicFilter(MODEL), []
    for k in range(round(seconds * 1e3)):
        now, arrived = 1e-3 * k, []
        if k % 10 == 8:
            stamp = now - LATE_S
            value = 2e-3 * stamp + 0.5e-3 * rng.standard_normal() + (wild if k % 200 == 8 and k > 1000 else 0.0)
            arrived = [Measurement("position_m", value, stamp)]
        off.append(seen.observe(now, 0.0, arrived).state[0] - 2e-3 * now)
    return seen, np.array(off)


def test_unbiased_and_quieter_than_the_sensor() -> None:
    _, off = along_a_ramp(20.0)
    late = off[5000:]
    assert abs(late.mean()) < 0.05e-3
    assert late.std() < 0.5 * 0.5e-3


def test_outliers_change_nothing() -> None:
    seen, off = along_a_ramp(20.0, wild=20e-3)
    assert seen.counts.outliers == 95
    assert np.abs(off[5000:]).max() < 0.8e-3


def test_lost_without_positions_and_nothing_breaks_it() -> None:
    seen, _ = along_a_ramp(2.0)
    bad = [
        Measurement("position_m", math.nan, 2.0),
        Measurement("position_m", 1e300, 2.0),
        Measurement("position_m", 0.0, math.inf),
    ]
    assert np.isfinite(seen.observe(2.0, math.nan, bad).state).all()
    assert seen.observe(2.5, 0.0).lost
    with pytest.raises(ValueError, match="jerkiness must be a positive number"):
        KinematicFilter(MODEL, 0.0)


def test_only_the_classical_controllers_get_it() -> None:
    assert isinstance(estimator_for("pid", MODEL), KinematicFilter)
    assert isinstance(estimator_for("pid_friction", MODEL), KinematicFilter)
    for name in ("pid_estimated", "lqr", "feedforward", "mpc"):
        assert isinstance(estimator_for(name, MODEL), Estimator)
    for name in ("pid", "mpc"):
        assert isinstance(estimator_for(name, MODEL, "ukf"), UnscentedEstimator)
