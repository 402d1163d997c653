"""The estimators against the plant: position within its noise, late and wild measurements, drop-outs, NaN, and its own
doubt.
"""

import math

import numpy as np
import pytest

from controller.estimator.base import Estimator
from controller.estimator.cubature import CubatureEstimator
from controller.estimator.particle_filter import ParticleEstimator
from controller.estimator.ukf import UnscentedEstimator
from controller.signals import Array, Measurement
from controller.tuned import FilterNoise
from plant import layout as at
from plant.drives import TrueCoil, TrueMagnet
from plant.rig import Truth
from plant.sensing import Instrument
from plant.session import Instruments, Session
from tests.controller.loops import model_of

MODEL = model_of().sharp
each = pytest.mark.parametrize("kind", [CubatureEstimator, ParticleEstimator, UnscentedEstimator])


def follow(
    estimator: Estimator, duration_s: float, place: Instrument | None = None, truth: Truth | None = None, seed: int = 0
) -> tuple[Array, Array, Array]:
    """Estimated less true position, whether lost, and what the newest position alone would be off by, a row a tick."""
    session = Session(truth or Truth(TrueMagnet()), Instruments(localisation=place or Instrument()), seed)
    off, lost, raw, newest = [], [], [], 0.0
    for k in range(1, round(duration_s * 1e3) + 1):
        t = k * 1e-3
        readings = session.advance(1e-3 * t + 3e-3 * min(t, 1.0), t)
        estimate = estimator.observe(t, session.command, [Measurement(r.channel, r.value, r.stamp_s) for r in readings])
        x = session.plant.state[at.S_X]
        newest = next((r.value for r in readings if r.channel == "position_m"), newest)
        off.append(estimate.state[0] - x)
        lost.append(estimate.lost)
        raw.append(newest - x)
    return np.array(off), np.array(lost), np.array(raw)


@each
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_an_innovation_has_the_sign_of_what_was_measured_beyond_what_was_expected(
    kind: type[Estimator], side: float
) -> None:
    estimator = kind(MODEL)
    for k in range(50):
        estimator.observe(1e-3 * k, 0.0, [Measurement("position_m", 0.0, 1e-3 * k)])
    (innovation,) = estimator.observe(0.05, 0.0, [Measurement("position_m", 5e-4 * side, 0.05)]).innovations
    assert side * innovation > 0.3


@each
def test_position_is_known_better_than_measured(kind: type[Estimator]) -> None:
    """Half of the sensor's noise or less, although tissue and magnet are off, and never lost once begun."""
    estimator = kind(MODEL)
    off, lost, raw = follow(estimator, 4.0, truth=Truth(TrueMagnet(24.0), hoop_factor=1.1))
    assert np.sqrt(np.mean(off[1000:] ** 2)) < 0.5 * np.sqrt(np.mean(raw[1000:] ** 2))
    assert not lost[200:].any()
    assert estimator.counts.outliers <= 2


@each
def test_latency_is_undone(kind: type[Estimator]) -> None:
    """Without noise, positions that are 40 ms late are as good as prompt ones."""
    estimator = kind(MODEL)
    off, _, raw = follow(estimator, 2.5, Instrument(std=0.0, latency_s=0.04))
    prompt, _, _ = follow(kind(MODEL), 2.5, Instrument(std=0.0, latency_s=0.0))
    assert abs(np.mean(off[1500:]) - np.mean(prompt[1500:])) < 0.3 * abs(np.mean(raw[1500:]))
    assert estimator.counts.accepted > 237
    assert np.mean(raw[1500:]) < -30e-6


@each
def test_outliers_are_refused(kind: type[Estimator]) -> None:
    """A twentieth of the readings anywhere within 30 mm: refused, and the estimate stays."""
    estimator = kind(MODEL)
    off, lost, _ = follow(estimator, 3.5, Instrument(outlier_share=0.05, outlier_size=30e-3))
    assert estimator.counts.outliers > 10
    assert np.sqrt(np.mean(off[1000:] ** 2)) < 0.3e-3
    assert not lost[1000:].any()


@each
def test_a_gap_is_bridged_and_said(kind: type[Estimator]) -> None:
    """Lost 150 ms after the last position, the path predicted meanwhile, found again with the first readings."""
    off, lost, _ = follow(kind(MODEL), 3.0, Instrument(gaps_s=(1.5, 1.0)))
    assert not lost[500:1640].any()
    assert lost[1700:2490].all()
    assert not lost[2530:].any()
    assert np.abs(off[1500:2500]).max() < 0.6e-3


@each
def test_nan_and_unknown_channels_change_nothing(kind: type[Estimator]) -> None:
    """NaN, infinity, far future, far past and unknown channels are counted, not used."""
    estimator = kind(MODEL)
    estimator.observe(0.0, 0.0, [Measurement("position_m", 0.0, 0.0)])
    before = estimator.observe(1e-3, 0.0)
    bad = [
        Measurement("position_m", math.nan, 1e-3),
        Measurement("position_m", math.inf, 1e-3),
        Measurement("position_m", 0.0, math.nan),
        Measurement("position_m", 0.0, 9.0),
        Measurement("position_m", 0.0, -9.0),
        Measurement("humidity", 0.4, 1e-3),
    ]
    after = estimator.observe(2e-3, math.nan, bad)
    assert estimator.counts.unusable == len(bad)
    assert after.state == pytest.approx(before.state, abs=1e-6)


@each
def test_moved_by_hand_it_begins_anew(kind: type[Estimator]) -> None:
    """Readings that stay elsewhere win after `outliers_in_a_row`; until they are proven the estimate counts as lost."""
    estimator = kind(MODEL)
    lost, places = [], []
    for k in range(1, 1001):
        t, x = k * 1e-3, 0.0 if k < 500 else 0.05
        seen = [Measurement("position_m", x, t)] if k % 10 == 0 else []
        estimate = estimator.observe(t, x, seen)
        lost.append(estimate.lost)
        places.append(estimate.state[0])
    assert estimator.counts.restarts == 1
    assert any(lost[500:700])
    assert not lost[-1]
    assert places[-1] == pytest.approx(0.05, abs=0.3e-3)


@each
def test_a_slip_that_the_model_does_not_know_is_followed_within_four_readings(kind: type[Estimator]) -> None:
    """The capsule lies still, then slips 8 mm at 0.12 m/s under a carriage that stays."""
    estimator = kind(MODEL)
    for k in range(1, 601):
        t = k * 1e-3
        x = 0.12 * min(max(t - 0.5, 0.0), 8e-3 / 0.12)
        seen = [Measurement("position_m", x, t)] if k % 10 == 0 else []
        estimate = estimator.observe(t, 0.0, seen)
        if k == 490:
            assert estimate.state[0] == pytest.approx(0.0, abs=0.3e-3)
        if k == 580:
            assert estimate.state[0] == pytest.approx(x, abs=2.5e-3)
    assert estimator.counts.followed > 0
    assert estimator.counts.restarts == 0


@each
def test_a_carriage_that_lags_behind_is_believed(kind: type[Estimator]) -> None:
    """Where the drive's own encoder says that the carriage is 1 mm short, the estimate goes by the encoder."""
    found = []
    for report in (False, True):
        estimator = kind(MODEL)
        for k in range(1, 1501):
            t = k * 1e-3
            seen = [Measurement("position_m", 0.0, t)] if k == 1 else []
            seen += [Measurement("carriage_position_m", 4e-3, t)] if report else []
            estimate = estimator.observe(t, 5e-3, seen)
        found.append(estimate.state[0])
    assert found[0] - found[1] == pytest.approx(1e-3, abs=0.4e-3)


@each
def test_a_coil_is_followed_too(kind: type[Estimator]) -> None:
    """Voltage in, position and current out: the current near its feedback, the position better than measured."""
    model = model_of("coil").sharp
    estimator = kind(model)
    session = Session(Truth(TrueCoil()), seed=1)
    off = []
    for k in range(1, 3001):
        t = k * 1e-3
        readings = session.advance(2.0, t)
        estimate = estimator.observe(t, 2.0, [Measurement(r.channel, r.value, r.stamp_s) for r in readings])
        off.append(estimate.state[0] - session.plant.state[at.S_X])
    assert session.plant.state[at.S_X] > 1e-3
    assert np.sqrt(np.mean(np.square(off[1000:]))) < 0.3e-3
    assert estimate.state[model.index(("coil", "current_A"))] == pytest.approx(
        session.plant.state[at.S_CURRENT], rel=0.05
    )


def test_impossible_noise_is_refused() -> None:
    """A noise without size would divide by zero."""
    with pytest.raises(ValueError, match="position_std_m"):
        FilterNoise(position_std_m=0.0)
