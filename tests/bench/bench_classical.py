"""How the classical PIDs were tuned: coordinate search on a nominal plant. `python -m tests.bench.bench_classical KIND
[--friction]`

Three runs a trial, 8 s each, seed 7: a ramp at 1 mm/s, a sine, and steps with rests; what counts is the rms of their
errors. Filter and gains vary together. Nothing that the benchmarks judge on takes part.
"""

import argparse
from typing import Any
from unittest.mock import patch

import numpy as np

from controller.baselines import PID
from controller.estimator.kinematic_filter import KinematicFilter
from controller.limits import Envelope
from controller.model.control_model import ControlModel, mean_friction
from controller.tuned import PidGains
from hil.app.scenario.scenario import TrackScenario, parse_track_scenario
from hil.app.track import loop as track_loop
from hil.app.track.score import score
from models.theta import Theta

REFERENCES: tuple[dict[str, Any], ...] = (
    {"kind": "ramp", "speed_mm_s": 1.0},
    {"kind": "sine", "amplitude_mm": 8.0, "frequency_Hz": 0.125},
    {"kind": "steps", "positions_mm": [4.0, 1.0], "speed_mm_s": 2.0, "dwell_s": 1.0},
)
GRID: dict[str, tuple[float, ...]] = {
    "k_p": (10, 20, 50, 100, 200, 400),
    "k_i": (0, 30, 100, 300, 600, 1200, 2500),
    "k_d": (0, 0.5, 1, 2, 4, 8),
    "jerkiness": (5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2),
}
START = {"k_p": 50.0, "k_i": 100.0, "k_d": 0.5, "jerkiness": 5e-3}
SWEEPS = 3


def nominal(kind: str) -> list[TrackScenario]:
    """A rig that is what the controller believes it to be."""
    drive = {"drive": {"gain_N_per_A": 0.5}} if kind == "coil" else {}
    head = {"scenario": {"duration_s": 8.5}, "rig": {"kind": kind}, **drive}
    return [parse_track_scenario({**head, "reference": reference}) for reference in REFERENCES]


def tried(numbers: dict[str, float], friction: bool, runs: list[tuple[TrackScenario, ControlModel]]) -> float:
    """Rms over the runs of the tracking error in mm."""
    gains = PidGains(numbers["k_p"], numbers["k_i"], numbers["k_d"])

    def chain(_: str, model: ControlModel, envelope: Envelope) -> tuple[PID, ...]:
        return (PID(model, envelope, gains, mean_friction(model) if friction else 0.0),)

    def seeing(_: str, model: ControlModel) -> KinematicFilter:
        return KinematicFilter(model, numbers["jerkiness"])

    with patch.object(track_loop, "build", chain), patch.object(track_loop, "estimator_for", seeing):
        errors = [score(s, track_loop.run_loop(s, m, "pid", 7)).tracking_rmse_m for s, m in runs]
    return 1e3 * float(np.sqrt(np.mean(np.square(errors))))


def main() -> None:
    """Print where each sweep of the search has come to."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("kind", choices=("magnetic", "coil"))
    options.add_argument("--friction", action="store_true")
    chosen = options.parse_args()
    runs = [(s, track_loop.believed_model(s, Theta())) for s in nominal(chosen.kind)]
    here, known = dict(START), dict[tuple[float, ...], float]()
    for _ in range(SWEEPS):
        before = dict(here)
        for name, values in GRID.items():
            for value in values:
                key = tuple({**here, name: value}.values())
                if key not in known:
                    known[key] = tried({**here, name: value}, chosen.friction, runs)
            # type: ignore[misc]
            here[name] = min(values, key=lambda value, name=name: known[tuple({**here, name: value}.values())])
        print(f"{here}: {known[tuple(here.values())]:.3f} mm after {len(known)} trials", flush=True)
        if here == before:
            break


if __name__ == "__main__":
    main()
