"""Every controller on the same seeds and random anatomies: tracking error, wall force, violations, step times, and the
figures to reach.

`python -m tests.bench.bench_tracking --anatomies 20` is the whole table: all controllers of a body drive on the slow
traverses of magnet and coil, each gut with a seed of its own. Without `--anatomies` the scenario's own gut, over
`--seeds`. `[--seeds 3] [--first 0] [--duration S] [--scenarios NAME... or all] [--controllers NAME...]` Judged are the
seeds from 0 on; tune on others (`--first 100`).
"""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.model.control_model import ControlModel
from controller.registry import CONTROLLERS, leads
from hil.app.scenario.scenario import TrackScenario, load_track_scenario
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import Score, score, wall_force
from models.theta import Theta
from plant import layout as at
from plant.anatomy import random_anatomy

FOLDER = Path(__file__).parents[2] / "hil" / "scenarios"
SLOW = ("magnetic_ramp", "coil_ramp_2")
HEAD = (
    "controller              rmse mm median (worst)  wall mN max  mean  violations  lost  drift mm"
    "  solve ms median/p99/max  estimate ms"
)
FIGURES = (("feedforward", "pid", 4.0), ("mpc", "pid_friction", 2.0))


@dataclass(frozen=True)
class Runs:
    """What one controller made of the same runs as the others: its scores, mean forces on the wall in N and drifts in
    m.
    """

    found: list[Score]
    mean_N: list[float]
    drift_m: list[float]

    @property
    def rmse_mm(self) -> NDArray[np.float64]:
        """Tracking error of each run."""
        return 1e3 * np.array([one.tracking_rmse_m for one in self.found])

    @property
    def most_mN(self) -> NDArray[np.float64]:
        """Largest force on the wall of each run."""
        return 1e3 * np.array([one.wall_force_max_N for one in self.found])


def variants(scenario: TrackScenario, seeds: range, anatomies: range) -> list[tuple[TrackScenario, int]]:
    """The scenario under each seed; with `anatomies`, each in another random gut."""
    if not anatomies:
        return [(scenario, seed) for seed in seeds]
    return [
        (replace(scenario, truth=replace(scenario.truth, anatomy=random_anatomy(seed))), seed) for seed in anatomies
    ]


def runs_of(controller: str, runs: list[tuple[TrackScenario, int]], model: ControlModel) -> Runs:
    """Run them all under one controller."""
    result = Runs([], [], [])
    for one, seed in runs:
        trace = run_loop(one, model, controller, seed)
        result.found.append(score(one, trace))
        result.mean_N.append(float(np.mean(np.abs(wall_force(one.truth, trace.rows)))))
        checks = one.checks[controller]
        if checks.drift_mm is not None and checks.drift_from_s is not None:
            late = trace.rows[trace.rows[:, at.O_T] > checks.drift_from_s]
            result.drift_m.append(float(np.ptp(late[:, at.O_X])) if late.size else np.nan)
    return result


def line(controller: str, runs: Runs) -> str:
    """One row of the table: medians over the runs, the worst, and step times of all."""
    solve, estimate = ([getattr(one, name) for one in runs.found] for name in ("solve_ms", "estimate_ms"))
    times = [
        f"{np.median([t['median'] for t in each]):.3f}/{max(t['p99'] for t in each):.3f}" for each in (solve, estimate)
    ]
    drift = f"{1e3 * max(runs.drift_m):.3f}" if runs.drift_m else "-"
    return (
        f"{controller:24s}{np.median(runs.rmse_mm):10.3f}"
        f" ({runs.rmse_mm.max():.3f}){np.median(runs.most_mN):15.1f}{1e3 * np.median(runs.mean_N):6.1f}"
        f"{sum(one.hard_violations for one in runs.found):12d}{sum(one.ticks['lost'] for one in runs.found):6d}"
        f"{drift:>10s}"
        f"  {times[0]}/{max(t['max'] for t in solve):.1f}  {times[1]}"
    )


def figures(found: Mapping[str, Runs]) -> list[str]:
    """How many times lower one's error is than another's, in the median and paired run by run, and the force on the
    wall beside it.
    """
    said = []
    for better, worse, times in FIGURES:
        if better not in found or worse not in found:
            continue
        one, other = found[better], found[worse]
        each = other.rmse_mm / one.rmse_mm
        said.append(
            f"{better} against {worse}: rmse {np.median(other.rmse_mm) / np.median(one.rmse_mm):.2f} times lower in the"
            f" median, {each.min():.2f} to {each.max():.2f} run by run (to reach: {times:g}); force on the wall"
            f" {100 * (np.median(one.mean_N) / np.median(other.mean_N) - 1):+.0f} % in the mean,"
            f" {100 * (np.median(one.most_mN) / np.median(other.most_mN) - 1):+.0f} % at its largest"
        )
    total = sum(one.hard_violations for runs in found.values() for one in runs.found)
    return [*said, f"hard violations over all runs: {total} (to reach: 0)"]


def measure(name: str, controllers: list[str], seeds: range, anatomies: range, duration_s: float | None) -> None:
    """The table of one scenario and its figures."""
    scenario = load_track_scenario(FOLDER / f"track_{name}.toml")
    if duration_s is not None:
        scenario = replace(scenario, duration_s=min(duration_s, scenario.duration_s))
    model = believed_model(scenario, Theta())
    runs = variants(scenario, seeds, anatomies)
    guts = f"{len(anatomies)} random guts, " if anatomies else ""
    print(f"\n{name}: {guts}{len(runs)} runs of {scenario.duration_s:g} s\n{HEAD}")
    found = {}
    for controller in controllers:
        if scenario.kind in leads(controller):
            found[controller] = runs_of(controller, runs, model)
            print(line(controller, found[controller]), flush=True)
    print("\n".join(figures(found)))


def main() -> None:
    """Read the options and print a table for each scenario."""
    every = sorted(p.stem.removeprefix("track_") for p in FOLDER.glob("track_*.toml"))
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--seeds", type=int, default=3)
    options.add_argument("--anatomies", type=int, default=0)
    options.add_argument("--duration", type=float, default=None)
    options.add_argument("--scenarios", nargs="*", default=list(SLOW), choices=[*every, "all"], metavar="NAME")
    options.add_argument(
        "--controllers", nargs="*", default=list(CONTROLLERS), choices=list(CONTROLLERS), metavar="NAME"
    )
    options.add_argument("--first", type=int, default=0)
    chosen = options.parse_args()
    seeds, guts = (range(chosen.first, chosen.first + n) for n in (chosen.seeds, chosen.anatomies))
    for name in every if "all" in chosen.scenarios else chosen.scenarios:
        measure(name, chosen.controllers, seeds, guts, chosen.duration)


if __name__ == "__main__":
    main()
