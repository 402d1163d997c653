"""The particles' arithmetic is Bayes' and filterpy's, nothing breaks it, and what it is for: a gut that changes along
the way.
"""

import numpy as np
import pytest
from filterpy.monte_carlo import systematic_resample
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from controller.estimator.base import Estimator
from controller.estimator.cubature import CubatureEstimator
from controller.estimator.kernels import draw, led, scatter, survey, weigh
from controller.estimator.particle_filter import ParticleEstimator
from controller.model.control_model import ControlModel
from controller.signals import Array, Measurement
from plant import layout as at
from plant.anatomy import random_anatomy
from plant.drives import TrueMagnet
from plant.rig import Truth
from plant.session import Session
from tests.controller.loops import model_of

MODEL = model_of().sharp


def errors(kind: type[Estimator], truth: Truth, seed: int, seconds: float = 8.0, model: ControlModel = MODEL) -> Array:
    """Estimated less true position in m, a tick each, behind a carriage that goes on at 1 mm/s."""
    estimator, session, off = kind(model), Session(truth, seed=seed), []
    for k in range(1, round(seconds * 1e3) + 1):
        t = k * 1e-3
        readings = session.advance(1e-3 * t + 3e-3 * min(t, 1.0), t)
        estimate = estimator.observe(t, session.command, [Measurement(r.channel, r.value, r.stamp_s) for r in readings])
        off.append(estimate.state[0] - session.plant.state[at.S_X])
    return np.array(off)


def test_in_guts_that_change_it_knows_more_than_the_gaussian_filter() -> None:
    """Over three guts, from 2 s on, in the root mean square and at least a tenth."""
    found = [
        [
            np.sqrt(np.mean(errors(kind, Truth(TrueMagnet(24.2), anatomy=random_anatomy(gut)), gut)[2000:] ** 2))
            for gut in range(200, 203)
        ]
        for kind in (ParticleEstimator, CubatureEstimator)
    ]
    particles, gaussian = np.sqrt(np.mean(np.square(found), axis=1))
    assert particles < 0.9 * gaussian


def test_the_same_measurements_give_the_same_estimate() -> None:
    """To the last bit, also after a reset: a log must replay alike."""
    one, other = (ParticleEstimator(MODEL) for _ in range(2))
    rng = np.random.default_rng(1)
    seen = [Measurement("position_m", 0.5e-3 * rng.standard_normal(), 0.01 * k) for k in range(1, 30)]
    paths = []
    for estimator in (one, other, one):
        estimator.reset(0.0, 0.0)
        paths.append(
            [
                estimator.observe(m.stamp_s + j * 1e-3, 4e-3, [m] if j == 0 else []).state
                for m in seen
                for j in range(10)
            ]
        )
    assert np.array_equal(paths[0], paths[1])
    assert np.array_equal(paths[0], paths[2])


def test_who_goes_on_is_filterpys_choice() -> None:
    """Systematic resampling from the same random start."""
    rng = np.random.default_rng(2)
    for seed in range(20):
        weights = rng.exponential(size=100)
        weights /= weights.sum()
        np.random.seed(seed)
        wanted = systematic_resample(weights)
        np.random.seed(seed)
        chosen = np.zeros(100, dtype=np.int64)
        draw(weights, np.random.random(), chosen)
        assert np.array_equal(chosen, wanted)


def test_weights_are_bayes() -> None:
    """Prior N(0, 1), a reading of 1 with variance 0.25: the posterior is N(0.8, 0.2)."""
    values = np.random.default_rng(3).standard_normal(200_000)
    weights = np.full(values.size, 1 / values.size)
    worth = weigh(weights, values, 1.0, 0.25)
    mean = weights @ values
    assert mean == pytest.approx(0.8, abs=0.01)
    assert weights @ (values - mean) ** 2 == pytest.approx(0.2, abs=0.01)
    assert worth == pytest.approx(1 / np.sum(weights**2))


@given(arrays(float, 16, elements=st.floats()), st.floats(), st.floats(1e-12, 1e3))
def test_weights_stay_weights(values: Array, measured: float, variance: float) -> None:
    """Whatever particles and readings are: no weight below 0, all sum to 1, and who is chosen exists."""
    weights, chosen = np.full(16, 1 / 16), np.zeros(16, dtype=np.int64)
    worth = weigh(weights, values, measured, variance)
    assert (weights >= 0).all()
    assert weights.sum() == pytest.approx(1.0)
    assert 0.999 <= worth <= 16.001
    draw(weights, 0.999, chosen)
    assert ((chosen >= 0) & (chosen < 16)).all()
    assert (weights[chosen] > 0).all()


def test_a_particle_without_weight_is_not_looked_at() -> None:
    """One that is no number neither shows in the moments nor leads."""
    states, level = np.array([[0.0, 1.0], [np.nan, np.nan], [2.0, 3.0]]), np.array([0.1, np.nan, 0.3])
    weights, mean, std = np.array([0.5, 0.0, 0.5]), np.zeros(2), np.zeros(2)
    found = survey(weights, states, level, level, mean, std)
    assert found == pytest.approx((0.2, 0.2))
    assert mean == pytest.approx([1.0, 2.0])
    assert std == pytest.approx([1.0, 1.0])
    assert led(weights, states, level, 1, mean, std, found[0], np.full(3, 2.0), -1) in (0, 2)


def test_a_leader_stays_until_it_is_far_off() -> None:
    """Two standard deviations are followed where 2.5 are allowed, not where 1.5 are; then the nearest takes over."""
    x = np.array([-2.0, -0.5, 0.0, 0.5, 2.0])
    states, level, weights = np.stack([x, x], axis=1), x.copy(), np.full(5, 0.2)
    mean, std = np.zeros(2), np.zeros(2)
    middle, _ = survey(weights, states, level, level, mean, std)
    far = x[4] / std[0]
    assert led(weights, states, level, 1, mean, std, middle, np.full(3, 1.1 * far), 4) == 4
    assert led(weights, states, level, 1, mean, std, middle, np.full(3, 0.9 * far), 4) == 2


def test_levels_walk_at_their_own_pace() -> None:
    """Calm and brisk particles spread as told, none leaves the bounds, and as many change sides as drawn."""
    n, rng = 20_000, np.random.default_rng(4)
    x, level, force, brisk = np.zeros(n), np.zeros(n), np.zeros(n), np.repeat([0.0, 1.0], n // 2)
    before = brisk.copy()
    walks, bounds = np.array([1e-3, 0.01, 0.1, 2e-3, 0.2]), np.array([-0.15, 0.15])
    scatter(x, level, force, brisk, walks, bounds, rng.standard_normal((3, n)), rng.random(n))
    assert np.mean(brisk != before) == pytest.approx(0.1, abs=0.01)
    assert np.std(level[brisk == 0]) == pytest.approx(0.01, rel=0.05)
    assert np.abs(level).max() <= 0.15
    assert np.std(x) == pytest.approx(1e-3, rel=0.05)
    assert np.std(force) == pytest.approx(2e-3, rel=0.05)
