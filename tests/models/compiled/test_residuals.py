"""Compiled passes from a model's output to residuals, each against plain NumPy."""

import numpy as np
import pytest

from models.compiled.residuals import Array, in_time, products, sampled, weighed

N, LANES = 400, 8


def plain_weighed(
    predicted: Array, measured: Array, counted: Array, averaged: int, noise: float, most: float, tail: float
) -> Array:
    """The residuals of one run (n,)."""
    r = (measured - predicted) / noise
    r = np.clip(np.where(np.isnan(r), most, r), -most, most)[counted]
    r = r[: len(r) // averaged * averaged].reshape(-1, averaged).mean(axis=1) * np.sqrt(averaged)
    return np.asarray(r * np.sqrt(2 / (1 + np.sqrt(1 + (r / tail) ** 2))))


@pytest.mark.parametrize("late", [np.zeros(LANES), np.linspace(-3.3, 7.9, LANES)])
def test_what_an_observer_sees_late_is_straight_between_samples(late: Array) -> None:
    samples, at = np.random.default_rng(0).standard_normal(N), np.arange(N)
    samples[50:70] = np.nan
    want = np.stack([np.interp(at + n, at, samples) for n in late], axis=1)
    np.testing.assert_allclose(in_time(samples, late, N, 0, 1), want, rtol=1e-12)
    steps = np.arange(4 * N + 3)
    want = np.stack([np.interp((steps - 1) / 4 + n, at, samples) for n in late], axis=1)
    np.testing.assert_allclose(in_time(samples, late, len(steps), 1, 4), want, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("late", [np.zeros(LANES), np.r_[0.0, np.linspace(-0.02, 0.05, LANES - 1)]])
@pytest.mark.parametrize("same", [False, True])
def test_outputs_are_straight_between_stamps(late: Array, same: bool) -> None:
    rng = np.random.default_rng(1)
    clock = np.linspace(2.0, 6.0, N)
    times = clock if same else np.sort(rng.uniform(1.9, 6.1, N // 2))
    shown, rows = rng.standard_normal((N, LANES)), np.array([9, 2, 3, 4, 5])
    out = np.zeros((10, len(times)))
    sampled(shown, clock, times, late, same, rows, out)
    for lane, row in enumerate(rows):
        want = np.interp(times - late[lane], clock, shown[:, lane])
        np.testing.assert_allclose(out[row], want, rtol=1e-12, atol=1e-13)
        if same and not late[lane]:
            np.testing.assert_array_equal(out[row], shown[:, lane])
    assert not out[[0, 1, 6, 7, 8]].any()


@pytest.mark.parametrize("averaged", [1, 7])
@pytest.mark.parametrize("tail", [8.0, np.inf])
def test_residuals_are_in_units_of_the_noise_with_less_weight_in_the_tail(averaged: int, tail: float) -> None:
    rng = np.random.default_rng(2)
    measured, predicted = rng.standard_normal(N), rng.standard_normal((3, N)) * np.array([[0.01], [1.0], [1e5]])
    predicted[1, :4] = np.nan, np.inf, -np.inf, 1e300
    counted = np.flatnonzero(rng.random(N) > 0.2)
    got = weighed(predicted, measured, counted, averaged, 0.03, 1e6, tail)
    want = [plain_weighed(row, measured, counted, averaged, 0.03, 1e6, tail) for row in predicted]
    np.testing.assert_allclose(got, want, rtol=1e-11, atol=1e-12)
    assert got.flags.c_contiguous


@pytest.mark.parametrize("shape", [(1, 3), (5, 512), (24, 5003)])
def test_products_are_those_of_numpy_and_the_same_every_time(shape: tuple[int, int]) -> None:
    rows = np.random.default_rng(3).standard_normal(shape)
    got = products(rows)
    np.testing.assert_allclose(got, rows @ rows.T, rtol=1e-12, atol=1e-12 * shape[1])
    for shift in range(1, 4):  # the same wherever the rows lie in memory
        moved = np.empty(rows.size + shift)[shift:].reshape(shape)
        moved[:] = rows
        np.testing.assert_array_equal(products(moved), got)
    np.testing.assert_array_equal(got, got.T)
