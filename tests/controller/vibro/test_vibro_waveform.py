"""Waveforms and gears: impulse kept over ticks, blends, flips, rests; a gear's speeds only grow."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.vibro.gears import DriveMap, Gear
from controller.vibro.waveform import REST, Waveform, blend

SQUARE = Waveform.square(0.05, 0.25, 0.8)
LEVELS = st.lists(st.floats(0, 1), min_size=1, max_size=12)


@given(levels=LEVELS, cuts=st.lists(st.floats(0.001, 0.999), max_size=8, unique=True))
def test_means_over_any_cuts_keep_the_cycles_impulse(levels: list[float], cuts: list[float]) -> None:
    wave = Waveform.even(0.03, np.array(levels))
    edges = [0.0, *sorted(cuts), 1.0]
    whole = sum(wave.mean(a, b) * (b - a) for a, b in pairwise(edges))
    assert whole == pytest.approx(np.mean(levels), abs=1e-12)
    assert np.mean(wave.sampled(7)) == pytest.approx(np.mean(levels), abs=1e-12)


@given(levels=LEVELS, factor=st.floats(0, 5), share=st.floats(0.01, 1))
def test_whatever_is_made_of_a_waveform_stays_within_the_coil_s_range(
    levels: list[float], factor: float, share: float
) -> None:
    wave = Waveform.even(0.03, np.array(levels))
    for made in (wave.scaled(factor), wave.flipped(), blend(wave, SQUARE, share)):
        assert all(0 <= level <= 1 for level in made.levels)


def test_a_blend_goes_from_one_to_the_other() -> None:
    other = Waveform.square(0.08, 0.5, 0.4)
    assert blend(SQUARE, other, 0.0) is SQUARE
    assert blend(SQUARE, other, 1.0) is other
    middle = blend(SQUARE, other, 0.5)
    assert middle.period_s == pytest.approx(np.sqrt(0.05 * 0.08))
    assert np.allclose(middle.sampled(48), 0.5 * (SQUARE.sampled(48) + other.sampled(48)))


@pytest.mark.parametrize(
    ("edges", "levels", "message"),
    [
        ((0.0, 0.5), (0.1,), "edges must rise from 0 to 1"),
        ((0.0, 0.6, 0.4, 1.0), (0.1, 0.2, 0.3), "edges must rise"),
        ((0.0, 1.0), (1.2,), r"levels must lie in \[0, 1\]"),
        ((0.0, 1.0), (0.2, 0.3), "edges must be one more than levels"),
    ],
)
def test_no_waveform_of_nonsense(edges: tuple[float, ...], levels: tuple[float, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Waveform(0.05, edges, levels)


GEARS = DriveMap(
    (
        Gear(tuple(SQUARE.scaled(f) for f in (0.3, 0.6, 1.2)), (2e-3, 9e-3, 40e-3), 14e-3),
        Gear(tuple(SQUARE.scaled(f) for f in (0.2, 0.4, 0.5)), (1e-3, 4e-3, 6e-3), 4e-3),
        Gear(tuple(SQUARE.flipped().scaled(f) for f in (0.5, 1.0)), (-3e-3, -25e-3), -14e-3),
    ),
    0.1,
)


def test_the_nearest_gear_is_taken_kept_and_left_where_it_ends() -> None:
    assert GEARS.choose(5e-3).gear == 1
    assert GEARS.choose(12e-3).gear == 0
    assert GEARS.choose(5e-3, 0).gear == 0
    assert GEARS.choose(12e-3, 1).gear == 0
    assert GEARS.choose(-5e-3, 0).gear == 2
    assert max(GEARS.choose(9e-3, 0).waveform.levels) == pytest.approx(0.6 * 0.8)


def test_what_is_out_of_reach_is_said_and_rest_is_rest() -> None:
    far = GEARS.choose(60e-3)
    assert (far.reachable, far.speed_m_s) == (False, 40e-3)
    assert GEARS.choose(-60e-3).speed_m_s == -25e-3
    assert GEARS.choose(0.0).waveform is REST
    assert not GEARS.choose(float("nan")).reachable
    assert not DriveMap((), 0.1).choose(1e-3).reachable
    assert GEARS.reach() == (-25e-3, 40e-3)


def test_below_its_path_a_gear_goes_on_at_less_strength() -> None:
    slow = GEARS.gears[2].waveform(-1.5e-3)
    assert slow.levels == SQUARE.flipped().scaled(0.5 * 0.75).levels


def test_a_gear_s_speeds_grow_and_keep_their_sign() -> None:
    with pytest.raises(ValueError, match="grow in size"):
        Gear((SQUARE, SQUARE), (3e-3, 2e-3), 1e-3)
    with pytest.raises(ValueError, match="of one sign"):
        Gear((SQUARE, SQUARE), (-1e-3, 2e-3), 1e-3)
