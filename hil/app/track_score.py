"""What a closed-loop run is worth: tracking, effort, force on the wall, limits, step times; judged on the truth of the plant."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.limits import Limits
from hil.app.track_loop import Trace
from hil.app.track_scenario import TrackScenario
from plant import layout as at
from plant.rig import Coil, Magnet, Rig, Vibro

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Score:
    """SI. `effort` is the rms of the drive's force in N; `hard_violations` counts ticks in which the truth broke a limit."""

    tracking_rmse_m: float
    tracking_max_m: float
    final_error_m: float
    mean_speed_m_s: float
    reference_mean_speed_m_s: float
    wall_force_max_N: float
    effort: float
    hard_violations: int
    solve_ms: dict[str, float]
    real_time_factor: float


def score(scenario: TrackScenario, trace: Trace) -> Score:
    """The numbers of `trace`; errors are those of the true position from `[control] judged_from_s` on."""
    rows = trace.rows
    t, x = rows[:, at.O_T], rows[:, at.O_X]
    judged = t >= scenario.control.judged_from_s
    target = scenario.reference.position(t)
    error = (x - target)[judged]
    span = t[judged][-1] - t[judged][0]
    solve = 1e3 * trace.solve_s
    return Score(
        float(np.sqrt(np.mean(error**2))),
        float(np.max(np.abs(error))),
        float(error[-1]),
        float((x[judged][-1] - x[judged][0]) / span),
        float((target[judged][-1] - target[judged][0]) / span),
        float(np.max(np.abs(wall_force(scenario.truth, rows)))),
        float(np.sqrt(np.mean(rows[judged, at.O_FORCE] ** 2))),
        violations(scenario.truth, scenario.limits, rows, scenario.control.tick_s),
        {
            "median": float(np.median(solve)),
            "p99": float(np.percentile(solve, 99)),
            "max": float(np.max(solve)),
            "failed": sum(status in ("failed", "late", "stopped") for status in trace.status),
        },
        scenario.duration_s / trace.wall_clock_s if trace.wall_clock_s > 0 else math.inf,
    )


def wall_force(truth: Rig, rows: Array) -> Array:
    """Force in N with which the capsule presses on along the lumen: the drive's less what accelerates the masses; (rows - 1,)."""
    dt = np.diff(rows[:, at.O_T])
    pushed = rows[:-1, at.O_FORCE] - truth.capsule.mass_kg * np.diff(rows[:, at.O_V]) / dt
    if isinstance(truth.drive, Vibro):
        inner = truth.drive.inner_mass_kg * np.diff(rows[:, at.O_INNER_V]) / dt
        pushed = pushed - inner - (rows[:-1, at.O_FORCE] if truth.drive.reaction_on_body else 0.0)
    return np.asarray(pushed)


def violations(truth: Rig, limits: Limits, rows: Array, tick_s: float) -> int:
    """Ticks in which the true state broke a limit: force on the tissue, speed, current, or the gap beyond which the magnet lets go."""
    broken = np.abs(rows[:, at.O_V]) > limits.speed_m_s
    if not isinstance(truth.drive, Vibro):
        broken[:-1] |= np.abs(wall_force(truth, rows)) > limits.force_N
    if isinstance(truth.drive, Magnet):
        broken |= np.abs(rows[:, at.O_DRIVE] - rows[:, at.O_X]) > truth.drive.magnet_range_m / math.sqrt(3)
    if isinstance(truth.drive, Coil):
        broken |= np.abs(rows[:, at.O_CURRENT]) > limits.current_A * (1 + 1e-9)
    return int(np.unique(np.floor(rows[broken, at.O_T] / tick_s + 1e-6)).size)


def document(
    scenario: TrackScenario, name: str, controller: str, seed: int, model: str, result: Score, log: str | None
) -> dict[str, Any]:
    """The JSON object of `capsule track`, in the keys of interfaces.md."""
    return {
        "scenario": name,
        "controller": controller,
        "seed": seed,
        "model": model,
        **{key: getattr(result, key) for key in Score.__dataclass_fields__},
        "log": log,
    }
