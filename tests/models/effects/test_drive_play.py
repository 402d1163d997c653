"""A step of play meets and leaves its ends at the exact moments; without play and friction it is an elastic drive's."""

import numpy as np
import pytest

from models.effects.effect import Signals
from models.effects.force import DrivePlay, ElasticDrive

P = {"load_kg": 1.0, "frequency_Hz": 20.0, "damping": 0.3, "play_m": 2e-3, "rubbing_m_s2": 0.0}
S = Signals(v=0.1)


def stepped(z: dict[str, float], seconds: float, count: int) -> dict[str, float]:
    for _ in range(count):
        z = DrivePlay().advance(S, P, z, seconds / count)
    return z


@pytest.mark.parametrize("seconds", [0.005, 0.012, 0.025, 0.04])
def test_a_long_step_across_the_gap_and_back_is_that_of_short_ones(seconds: float) -> None:
    start = {"stretch_m": -0.5e-3, "load_m_s": -0.05}
    once, often = stepped(start, seconds, 1), stepped(start, seconds, 997)
    assert np.allclose([*once.values()], [*often.values()], rtol=1e-9, atol=1e-12)


def test_in_the_gap_nothing_pulls_and_friction_stops_the_load() -> None:
    z = {"stretch_m": 0.0, "load_m_s": 0.1}
    assert DrivePlay().force(S, P, z) == 0.0
    rubbed = DrivePlay().advance(S, {**P, "rubbing_m_s2": 5.0}, z, 0.01)
    assert rubbed["load_m_s"] == pytest.approx(0.05)
    assert DrivePlay().advance(S, {**P, "rubbing_m_s2": 50.0}, z, 0.01)["load_m_s"] == 0.0


def test_without_play_a_pull_is_an_elastic_drives() -> None:
    z, p = {"stretch_m": 1e-3, "load_m_s": 0.08}, {**P, "play_m": 0.0}
    assert DrivePlay().force(S, p, z) == pytest.approx(ElasticDrive().force(S, p, z))
    both = [effect().advance(S, p, z, 0.004) for effect in (DrivePlay, ElasticDrive)]
    assert np.allclose(*([one["stretch_m"], one["load_m_s"]] for one in both), rtol=1e-12)
