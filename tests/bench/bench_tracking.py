"""Every controller on the shipped scenarios over seeds and random anatomies: tracking error, wall force, violations, step times.

`python -m tests.bench.bench_tracking [--seeds 3] [--first 0] [--anatomies 0] [--scenarios NAME...] [--controllers NAME...]`
Judged are the seeds from 0 on; tune on others (`--first 100`).
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from controller.choices import CONTROLLERS, leads
from hil.app.track_loop import believed_model, run_loop
from hil.app.track_scenario import TrackScenario, load_track_scenario
from hil.app.track_score import score, wall_force
from plant import layout as at
from plant.anatomy import random_anatomy

FOLDER = Path(__file__).parents[2] / "hil" / "scenarios"


def variants(scenario: TrackScenario, seeds: range, anatomies: range) -> list[tuple[TrackScenario, int]]:
    """The scenario under each seed; with `anatomies`, each in another random gut."""
    if not anatomies:
        return [(scenario, seed) for seed in seeds]
    return [(replace(scenario, truth=replace(scenario.truth, anatomy=random_anatomy(seed))), seed) for seed in anatomies]


def measure(name: str, controllers: list[str], seeds: range, anatomies: range, duration_s: float | None) -> None:
    """One table row a controller: medians over the runs, and the worst."""
    scenario = load_track_scenario(FOLDER / f"track_{name}.toml")
    if duration_s is not None:
        scenario = replace(scenario, duration_s=min(duration_s, scenario.duration_s))
    model = believed_model(scenario, {})
    runs = variants(scenario, seeds, anatomies)
    print(
        f"\n{name}: {len(runs)} runs of {scenario.duration_s:g} s\n"
        "controller      rmse mm median (worst)  wall mN max  mean  violations  drift mm  solve ms"
    )
    for controller in controllers:
        if scenario.kind not in leads(controller):
            continue
        found, drifts, means = [], [], []
        for one, seed in runs:
            trace = run_loop(one, model, controller, seed)
            found.append(score(one, trace))
            means.append(float(np.mean(np.abs(wall_force(one.truth, trace.rows)))))
            late = trace.rows[trace.rows[:, at.O_T] > one.duration_s - 60.0]
            drifts.append(float(np.ptp(late[late[:, at.O_T] > 6.0][:, at.O_X])) if "hold" in name else np.nan)
        rmse = 1e3 * np.array([one.tracking_rmse_m for one in found])
        print(
            f"{controller:14s} {np.median(rmse):8.3f} ({rmse.max():.3f})"
            f" {1e3 * np.median([one.wall_force_max_N for one in found]):15.1f} {1e3 * np.median(means):5.1f}"
            f" {sum(one.hard_violations for one in found):9d}"
            f" {1e3 * np.max(drifts):10.3f} {np.median([one.solve_ms['median'] for one in found]):9.3f}",
            flush=True,
        )


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seeds", type=int, default=3)
    options.add_argument("--anatomies", type=int, default=0)
    options.add_argument("--duration", type=float, default=None)
    options.add_argument(
        "--scenarios", nargs="*", default=sorted(p.stem.removeprefix("track_") for p in FOLDER.glob("track_*.toml"))
    )
    options.add_argument("--controllers", nargs="*", default=list(CONTROLLERS))
    options.add_argument("--first", type=int, default=0)
    chosen = options.parse_args()
    chosen_seeds, chosen_guts = (range(chosen.first, chosen.first + n) for n in (chosen.seeds, chosen.anatomies))
    for scenario_name in chosen.scenarios:
        measure(scenario_name, chosen.controllers, chosen_seeds, chosen_guts, chosen.duration)
