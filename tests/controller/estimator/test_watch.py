"""What refused positions say: the capsule slipped, the sensor jumped, or nothing yet."""

import pytest

from controller.estimator.base import Watch, Wrong
from controller.tuned import FilterNoise

NOISE = FilterNoise(position_std_m=1e-4)
EVERY_S = 0.01


def told(values_m: list[float]) -> list[Wrong]:
    """What is said of positions that are all refused, one every 10 ms, after one at 0 that fitted."""
    watch = Watch(NOISE)
    watch.accept(0.0, 0.0, 0.0)
    said = []
    for k, value in enumerate(values_m, start=1):
        said.append(watch.refuse(value, EVERY_S * k, EVERY_S * k))
        if said[-1] is Wrong.ALL:
            watch.begin(EVERY_S * k)
    return said


def test_a_slip_is_followed_after_three_readings() -> None:
    assert told([1.5e-3, 3e-3, 4.5e-3]) == [Wrong.NOTHING, Wrong.NOTHING, Wrong.POSITION]


def test_a_reading_far_away_is_a_jump_however_calm_the_next_ones_are() -> None:
    said = told([1e-2] * NOISE.outliers_in_a_row)
    assert said[:-1] == [Wrong.NOTHING] * (NOISE.outliers_in_a_row - 1)
    assert said[-1] is Wrong.ALL


@pytest.mark.parametrize("far_m", [5e-3, 0.1])
def test_readings_to_and_fro_are_never_followed(far_m: float) -> None:
    said = told([far_m * (-1) ** k for k in range(NOISE.outliers_in_a_row)])
    assert Wrong.POSITION not in said


def test_a_reading_that_fits_ends_a_jump() -> None:
    watch = Watch(NOISE)
    watch.accept(0.0, 0.0, 0.0)
    watch.refuse(0.05, 0.01, 0.01)
    watch.accept(0.0, 0.02, 0.02)
    said = [watch.refuse(1e-3 * k, 0.02 + EVERY_S * k, 0.0) for k in range(1, 4)]
    assert said[-1] is Wrong.POSITION
    assert watch.counts.followed == 1
    assert watch.counts.restarts == 0
