"""A million ticks of each estimator without divergence, and what a tick costs. `python -m
tests.bench.bench_estimator`.
"""

import argparse
import time

import numpy as np

from controller.estimator.base import Estimator
from controller.estimator.cubature import CubatureEstimator
from controller.estimator.particle_filter import ParticleEstimator
from controller.estimator.ukf import UnscentedEstimator
from controller.signals import Measurement
from tests.controller.loops import model_of, ticked


def endure(kind: type[Estimator], steps: int) -> None:
    """Carriage to and fro under slow changes, noisy positions each tenth tick, one in a hundred wild."""
    model = model_of().sharp
    estimator, rng = kind(model), np.random.default_rng(0)
    truth, command, worst, began = model.initial(), 0.0, 0.0, time.perf_counter()
    lost = 0
    for k in range(1, steps + 1):
        now, command = k * 1e-3, 8e-3 * np.sin(1.3e-3 * k) + 2e-3 * np.sin(1.7e-4 * k)
        truth = ticked(model.kernels, truth, command, 3e-3 * np.sin(1e-4 * k), now)
        seen = []
        if k % 10 == 0:
            wild = 20e-3 * rng.standard_normal() if rng.random() < 0.01 else 0.0
            seen = [Measurement("position_m", truth[0] + 0.5e-3 * rng.standard_normal() + wild, now)]
        estimate = estimator.observe(now, command, seen)
        if k > 1000:
            worst, lost = max(worst, abs(estimate.state[0] - truth[0])), lost + estimate.lost
    print(
        f"{kind.__name__}, {steps} ticks in {time.perf_counter() - began:.0f} s: worst error {1e3 * worst:.3f} mm, lost"
        f" {lost}, {estimator.counts}"
    )


def cost(kind: type[Estimator], ticks: int) -> None:
    """us a tick, prediction alone and with a position 8 ms late."""
    model = model_of().sharp
    estimator = kind(model)
    plain: list[float] = []
    late: list[float] = []
    estimator.observe(0.0, 0.0, [Measurement("position_m", 0.0, 0.0)])
    for k in range(1, ticks + 1):
        now, command = k * 1e-3, 4e-3 + 1e-6 * k
        seen = [Measurement("position_m", 1e-6 * k, now - 8e-3)] if k % 10 == 0 else []
        start = time.perf_counter()
        estimator.observe(now, command, seen)
        (late if seen else plain).append(time.perf_counter() - start)
    for name, times in (("tick", plain), ("tick with a position 8 ms late", late)):
        print(
            f"{kind.__name__}, {name}: median {1e6 * np.median(times):.1f} us, p99"
            f" {1e6 * np.percentile(times, 99):.1f} us"
        )


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--steps", type=int, default=1_000_000)
    options.add_argument("--ticks", type=int, default=5000)
    chosen = options.parse_args()
    for kind in (ParticleEstimator, CubatureEstimator, UnscentedEstimator):
        cost(kind, chosen.ticks)
        endure(kind, chosen.steps)
