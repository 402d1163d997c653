"""How well anyone could follow a capsule through a gut that nobody knows, with the localisation that controllers have.

`python -m tests.bench.bench_bound [--guts 800] [--speed_mm_s 1]` pulls a capsule stiffly along a ramp through random
guts, turns the force of each, without its teeth, into the gap at which the ramp's magnet gives it, and prints how much
of that gap the best linear filter leaves unknown that knows these guts' statistics, the magnet and everything else, but
not which gut it is: with the localisation's rate and noise. The statistics are those of one half of the guts, the error
is that in the other half. A capsule cannot be held closer to its path than it is known to be; what its teeth tell
beyond that no linear filter sees.
"""

import argparse
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from hil.app.scenario.scenario import load_track_scenario
from plant import layout as at
from plant.anatomy import random_anatomy
from plant.drives import TrueMagnet, TruePull
from plant.rig import STEP_S, Plant, Truth
from plant.session import Instruments
from tests.bench.bench_tracking import FOLDER

SECONDS, STARTED_S, FIRST, LAST = 14.0, 2.0, 20, -20
EVERY_S, TEETH_HZ = 0.05, 0.5
_MEANS = 50  # readings of the force in each of them

Floats = NDArray[np.float64]


def gap(force_N: Floats, magnet: TrueMagnet) -> Floats:
    """The gap in m at which the magnet pulls with `force_N`, short of its greatest pull."""
    k, r = magnet.magnet_stiffness_N_per_m, magnet.magnet_range_m
    gaps = np.linspace(0.0, r / np.sqrt(3), 2000)
    return np.interp(force_N, k * gaps / (1 + (gaps / r) ** 2) ** 2, gaps)


def gaps(rig: Truth, magnet: TrueMagnet, guts: range, speed_m_s: float) -> Floats:
    """One row a gut: gaps in m every `EVERY_S` along the ramp, teeth taken out."""
    every = round(EVERY_S / STEP_S) // _MEANS
    low_pass = butter(2, TEETH_HZ, fs=1 / EVERY_S, output="sos")
    path = speed_m_s * STEP_S * np.arange(round(SECONDS / STEP_S), dtype=np.float64)
    rows = []
    for seed in guts:
        plant = Plant(replace(rig, drive=TruePull(), anatomy=random_anatomy(seed)))
        seen = plant.advance(path, every)
        mean = seen[: len(seen) // _MEANS * _MEANS, at.O_FORCE].reshape(-1, _MEANS).mean(axis=1)
        rows.append(gap(sosfiltfilt(low_pass, mean)[round(STARTED_S / EVERY_S) :], magnet))
    return np.array(rows)


def left(found: Floats, instruments: Instruments) -> Floats:
    """What the filter leaves unknown of the gap in each gut of the second half, rms in m over the run but its ends."""
    known, judged = np.array_split(found, 2)
    mean, n = known.mean(axis=0), found.shape[1]
    covariance = (known - mean).T @ (known - mean) / len(known)
    sensor = instruments.localisation
    noise = sensor.std**2 / (sensor.rate_Hz * EVERY_S)
    moved = judged - mean
    seen = moved + np.sqrt(noise) * np.random.default_rng(0).standard_normal(moved.shape)
    gains = [np.linalg.solve(covariance[:k, :k] + noise * np.eye(k), covariance[:k, k]) for k in range(FIRST, n + LAST)]
    errors = [moved[:, FIRST + i] - seen[:, : FIRST + i] @ gain for i, gain in enumerate(gains)]
    return np.sqrt(np.mean(np.square(errors), axis=0))


def main() -> None:
    """Pull, filter, print."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--guts", type=int, default=800)
    options.add_argument("--speed_mm_s", type=float, default=1.0)
    options.add_argument("--first", type=int, default=1000)
    chosen = options.parse_args()
    scenario = load_track_scenario(FOLDER / "track_magnetic_ramp.toml")
    assert isinstance(scenario.truth.drive, TrueMagnet)
    guts = range(chosen.first, chosen.first + chosen.guts)
    found = gaps(scenario.truth, scenario.truth.drive, guts, 1e-3 * chosen.speed_mm_s)
    unknown = 1e3 * left(found, scenario.instruments)
    print(f"gap of the magnet in {chosen.guts} guts: {1e3 * found.mean():.2f} mm, spread {1e3 * found.std():.3f} mm")
    print(
        f"the best linear filter leaves {np.median(unknown):.3f} mm of it unknown in the median, at most"
        f" {unknown.max():.3f} mm"
    )


if __name__ == "__main__":
    main()
