"""The fast filter is filterpy's filter, and its covariance stays one over many steps and through any matrix."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.estimator.cubature import Process, fuse
from controller.estimator.kernels import root
from controller.estimator.ukf import FilterpyProcess, safe_root
from controller.tuned import FilterNoise
from tests.controller.loops import model_of

MODEL = model_of().sharp


def test_the_same_numbers_as_filterpy() -> None:
    """Through stick and slip, five ticks and a position from the same belief, the two filters agree to rounding."""
    process, other = Process(MODEL, FilterNoise(gate=100.0)), FilterpyProcess(MODEL, FilterNoise(gate=100.0))
    fast, slow = (process.start(0.0, 0.5e-3, 0.0, 0.0) for _ in range(2))
    rng = np.random.default_rng(3)
    modes, agreed = set(), 0
    for k in range(1, 1501):
        command = 4e-3 * min(k / 300, 1.0) + 2e-6 * k
        if k % 5 == 1:
            slow.copy_from(fast)
        process.predict(fast, command)
        other.predict(slow, command)
        if k % 10 == 0:
            value = 1e-6 * k + 0.5e-3 * rng.standard_normal()
            process.see(fast, value)
            other.see(slow, value)
        modes.add(float(fast.modes[MODEL.index("slip")]))
        spread = np.sqrt(np.diag(fast.P))
        agreed += bool(
            np.all(np.abs(fast.z - slow.z) < 1e-4 * spread)
            and np.all(np.abs(fast.P - slow.P) < 1e-3 * np.outer(spread, spread))
        )
    assert modes == {0.0, 1.0}
    assert agreed > 1480  # where the wall's tension is at its limit to rounding, the two may slip a tick apart


def test_covariance_stays_one() -> None:
    """Twenty thousand ticks to and fro: symmetric, positive, bounded. `bench_estimator` does a million."""
    process = Process(MODEL, FilterNoise())
    b = process.start(0.0, 0.5e-3, 0.0, 0.0)
    rng = np.random.default_rng(0)
    for k in range(1, 20001):
        process.predict(b, 6e-3 * np.sin(2e-3 * k))
        if k % 10 == 0:
            process.see(b, b.z[0] + 0.5e-3 * rng.standard_normal())
    assert np.isfinite(b.z).all()
    assert np.array_equal(b.P, b.P.T)
    assert np.linalg.eigvalsh(b.P / np.sqrt(np.outer(np.diag(b.P), np.diag(b.P)))).min() > 0
    assert np.sqrt(b.P[0, 0]) < 0.5e-3


@given(st.lists(st.floats(-1e3, 1e3), min_size=16, max_size=16))
def test_any_symmetric_matrix_gets_a_root(numbers: list[float]) -> None:
    """Finite whatever comes in; exact where the matrix is positive."""
    A = np.array(numbers).reshape(4, 4)
    L = np.zeros((4, 4))
    root(A + A.T, L)
    assert np.isfinite(L).all()
    good = A @ A.T + np.eye(4) * (1 + np.abs(A).max() ** 2)
    U = safe_root(good)
    assert pytest.approx(good, rel=1e-9, abs=1e-9 * np.abs(good).max()) == U.T @ U


def test_a_gated_measurement_changes_nothing() -> None:
    """Beyond the gate, or no number: the belief stays bit for bit."""
    z, P = np.array([1.0, 2.0]), np.array([[1.0, 0.2], [0.2, 2.0]])
    for difference in (50.0, np.nan, np.inf):
        before = z.copy(), P.copy()
        fuse(z, P, np.array([1.0, 0.0]), difference, 0.01, 5.0)
        assert np.array_equal(z, before[0])
        assert np.array_equal(P, before[1])
