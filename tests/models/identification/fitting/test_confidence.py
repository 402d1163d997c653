"""How sure a fitted number is."""

import numpy as np
import pytest

from models.identification.fitting.confidence import drawn, jackknife
from models.identification.fitting.fit import Fit
from tests.models.identification.kinds.axes import axis_kind


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


def test_only_what_is_told_moves_and_by_what_is_left_when_the_others_stay() -> None:
    """Viscous and Coulomb friction that the records hardly tell apart: alone each is told a hundred times as well."""
    kind, rng = axis_kind(1.0, 2.0, 3.0, 0.0), np.random.default_rng(1)
    names = [p.name for p in kind.base]
    common = rng.standard_normal(2000)
    columns = [rng.standard_normal(2000), common, common + 0.01 * rng.standard_normal(2000), rng.standard_normal(2000)]
    theta = kind.nominal()
    residual = rng.standard_normal(2000)
    fit = Fit(theta, float(residual @ residual), 2000, np.column_stack(columns), residual)
    both = [drawn(kind, fit, [], np.random.default_rng(k)) for k in range(60)]
    one = [drawn(kind, fit, [], np.random.default_rng(k), names[:2]) for k in range(60)]
    assert all(draw[name] == theta[name] for draw in one for name in names[2:])
    assert np.std([draw[names[1]] for draw in both]) > 30 * np.std([draw[names[1]] for draw in one]) > 0
