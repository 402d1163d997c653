"""How sure a fitted number is."""

import numpy as np
import pytest

from models.identification.intervals import jackknife


@pytest.mark.parametrize("groups", [2, 5, 12])
def test_the_jackknife_of_a_mean_is_its_standard_error(groups: int) -> None:
    """For the mean of equal groups the jackknife is exact: the groups' standard deviation over the root of their
    number.
    """
    means = np.random.default_rng(groups).normal(3.0, 0.4, groups)
    parts = [((groups - 1) / groups, float(np.delete(means, k).mean())) for k in range(groups)]
    assert jackknife(float(means.mean()), parts) == pytest.approx(means.std(ddof=1) / np.sqrt(groups))


def test_an_angle_is_as_far_off_as_the_shorter_way_round() -> None:
    assert jackknife(0.1, [(0.5, 2 * np.pi - 0.1)], "rad") == pytest.approx(0.2)
    assert jackknife(0.1, [(0.5, 2 * np.pi - 0.1)]) == pytest.approx(2 * np.pi - 0.2)


def test_a_fit_on_everything_says_nothing_of_the_scatter() -> None:
    assert jackknife(1.0, [(1.0, 2.0)]) == 0.0
