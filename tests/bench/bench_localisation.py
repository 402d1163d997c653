"""What each controller reaches with a slow or late localisation, and who may lead with it.

`python -m tests.bench.bench_localisation [--rigs magnetic coil vibro] [--seeds 1]` drives to and fro with 0.2 mm of
noise, with `limits.age_s` as long as the localisation needs. Prints the tracking error in mm, and why a run ended.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from hil.app.scenario.reference import Steps
from hil.app.scenario.scenario import TrackScenario, load_track_scenario
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import score
from models.theta import Theta

FOLDER: Final = Path(__file__).parents[2] / "hil" / "scenarios"
BODIES: Final = ("pid", "pid_estimated", "lqr", "feedforward", "mpc")
RIGS: Final = {
    "magnetic": ("magnetic_ramp", BODIES, 12.0, 2.0, 16.0),
    "coil": ("coil_ramp_2", BODIES, 12.0, 2.0, 16.0),
    "vibro": ("vibro_gut", ("vibro",), 40.0, 10.0, 12.0),
}
"""Scenario, controllers, how far in mm and how fast in mm/s to and fro, for how long in s."""
SIGHTS: Final = ((1, 8), (5, 8), (10, 8), (20, 8), (100, 8), (100, 50), (100, 100), (100, 150), (100, 200), (5, 200))
"""Rates in Hz and lateness in ms."""


def seen(rig: str, rate_Hz: float, late_s: float) -> TrackScenario:
    """The scenario of `rig` with such a localisation."""
    name, _, far, speed, seconds = RIGS[rig]
    plain = load_track_scenario(FOLDER / f"track_{name}.toml")
    one = replace(plain.instruments.localisation, rate_Hz=rate_Hz, latency_s=late_s, std=2e-4)
    return replace(
        plain,
        duration_s=seconds,
        reference=Steps(positions_mm=[far, 0.0], speed_mm_s=speed).trajectory(seconds),
        instruments=replace(plain.instruments, localisation=one),
        limits=replace(plain.limits, age_s=max(plain.limits.age_s, 1.2 / rate_Hz + late_s + 0.05)),
        control=plain.control.but(tick_s=2e-3),
        checks={},
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rigs", nargs="+", default=list(RIGS))
    parser.add_argument("--seeds", type=int, default=1)
    args = parser.parse_args()
    for rig in args.rigs:
        for name in RIGS[rig][1]:
            cells = []
            for rate, late in SIGHTS:
                scenario = seen(rig, rate, 1e-3 * late)
                model = believed_model(scenario, Theta())
                errors, ends = [], set[str]()
                for seed in range(args.seeds):
                    trace = run_loop(scenario, model, name, seed)
                    worth = score(scenario, trace)
                    errors.append(1e3 * worth.tracking_rmse_m)
                    ends |= {trace.halted.partition(":")[2].strip()[:40] or trace.halted} - {""}
                    ends |= {f"{worth.hard_violations} violations"} if worth.hard_violations else set()
                cells.append(f"{rate} Hz {late} ms {np.median(errors):.2f}" + (f" ({'; '.join(ends)})" if ends else ""))
            print(f"| {rig} {name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
