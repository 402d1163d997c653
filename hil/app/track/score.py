"""The score of a closed-loop run on the true state, and whether it passes the `[checks]` of its scenario."""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any, Final, get_args

import numpy as np

from controller.limits import Limits
from controller.signals import Array, Status
from hil.app.scenario.checks import TrackChecks, last_fault_s, legs, rests
from hil.app.scenario.model_use import health_of
from hil.app.scenario.scenario import TrackScenario
from hil.app.track.loop import LoopTrace
from plant import layout as at
from plant.drives import Carriage, TrueCoil, TrueMagnetPair, TrueVibro
from plant.rig import Truth

HARD: Final = ("speed", "force", "gap", "current")
"""Limits of the true state, those of `shares`; the others limit the command."""
STAYING_S: Final = 1.0
"""For so long an error must stay small to count as recovered: later slip events do not belong to the drop-out."""
_SELDOM = 100  # rows between those at which a magnet's attraction is evaluated


@dataclass(frozen=True)
class Score:
    """SI. `effort`: rms of the drive's force; `hard_violations`: ticks in which the true state broke a limit;
    `limit_use`: largest share of each limit; `ticks` by status; `estimator`: measurements accepted and refused;
    `events`: changes of the controller; `monitor`: health of the model.
    """

    tracking_rmse_m: float
    tracking_max_m: float
    final_error_m: float
    mean_speed_m_s: float
    reference_mean_speed_m_s: float
    wall_force_max_N: float
    effort: float
    hard_violations: int
    limit_use: dict[str, float]
    ticks: dict[str, int]
    estimator: dict[str, int]
    solve_ms: dict[str, float]
    estimate_ms: dict[str, float]
    real_time_factor: float
    events: list[dict[str, Any]]
    monitor: dict[str, Any]


def score(scenario: TrackScenario, trace: LoopTrace) -> Score:
    """The score of `trace`; errors are those of the true position from `[control] judged_from_s` on."""
    rows, truth = trace.rows, trace.truth or scenario.truth
    t, x = rows[:, at.O_T], rows[:, at.O_X]
    judged = t >= scenario.control.judged_from_s
    target = scenario.reference.position(t)
    error = (x - target)[judged]
    span = t[judged][-1] - t[judged][0]
    statuses = Counter(trace.status)
    return Score(
        float(np.sqrt(np.mean(error**2))),
        float(np.max(np.abs(error))),
        float(error[-1]),
        float((x[judged][-1] - x[judged][0]) / span),
        float((target[judged][-1] - target[judged][0]) / span),
        float(np.max(np.abs(wall_force(truth, rows)))),
        float(np.sqrt(np.mean(rows[judged, at.O_FORCE] ** 2))),
        violations(truth, scenario.limits, rows, scenario.control.tick_s),
        limit_use(scenario, trace),
        {status: statuses[status] for status in get_args(Status)},
        asdict(trace.counts),
        {**_times(trace.solve_s), "failed": sum(statuses[one] for one in ("failed", "late", "stopped"))},
        _times(trace.estimate_s),
        scenario.duration_s / trace.wall_clock_s if trace.wall_clock_s > 0 else math.inf,
        [asdict(event) for event in trace.events],
        health_of(trace.health),
    )


def wall_force(truth: Truth, rows: Array) -> Array:
    """Force in N on the lumen, (rows - 1,): the drive's force less the inertia of the masses."""
    dt = np.diff(rows[:, at.O_T])
    pushed = rows[:-1, at.O_FORCE] - truth.capsule.mass_kg * np.diff(rows[:, at.O_V]) / dt
    if isinstance(truth.drive, TrueVibro):
        inner = truth.drive.inner_mass_kg * np.diff(rows[:, at.O_INNER_V]) / dt
        pushed = pushed - inner - (rows[:-1, at.O_FORCE] if truth.drive.reaction_on_body else 0.0)
    return np.asarray(pushed)


def violations(truth: Truth, limits: Limits, rows: Array, tick_s: float) -> int:
    """Ticks in which the true state broke a limit, those of `shares`."""
    broken = np.zeros(rows.shape[0], dtype=bool)
    for share in shares(truth, limits, rows).values():
        broken[: share.size] |= share > 1 + 1e-9
    return int(np.unique(np.floor(rows[broken, at.O_T] / tick_s + 1e-6)).size)


def shares(truth: Truth, limits: Limits, rows: Array) -> dict[str, Array]:
    """The true state as a share of each limit, one value for each row; for the force one value less."""
    found = {"speed": np.abs(rows[:, at.O_V]) / limits.speed_m_s}
    if truth.drive.pushes:
        found["force"] = np.abs(wall_force(truth, rows)) / limits.force_N
    if isinstance(truth.drive, Carriage):
        found["gap"] = np.abs(rows[:, at.O_DRIVE] - rows[:, at.O_X]) / truth.drive.gap_limit_m
    if isinstance(truth.drive, TrueCoil):
        found["current"] = np.abs(rows[:, at.O_CURRENT]) / limits.current_A
    return found


def limit_use(scenario: TrackScenario, trace: LoopTrace) -> dict[str, float]:
    """The largest of `shares`, and those of a carriage's commanded speed, acceleration and travel."""
    limits, tick, truth = scenario.limits, scenario.control.tick_s, trace.truth or scenario.truth
    used = {name: float(np.max(share)) for name, share in shares(truth, limits, trace.rows).items()}
    magnets = scenario.belief.magnets
    if isinstance(truth.drive, TrueMagnetPair) and magnets is not None and magnets.pressing_limit_N is not None:
        gap = (trace.rows[:, at.O_DRIVE] - trace.rows[:, at.O_X])[::_SELDOM]
        used["pressing"] = float(np.max(truth.drive.forces(gap)[1])) / magnets.pressing_limit_N
    if isinstance(truth.drive, Carriage):
        command = trace.command[np.isfinite(trace.command)]
        speed = np.abs(np.diff(command)) / tick / limits.carriage_speed_m_s
        acceleration = np.abs(np.diff(command, 2)) / tick**2 / limits.carriage_acceleration_m_s2
        travel = np.abs(command) / limits.travel_m
        each = {"carriage_speed": speed, "carriage_acceleration": acceleration, "travel": travel}
        used |= {name: float(np.max(share, initial=0.0)) for name, share in each.items()}
    return used


def _times(seconds: Array) -> dict[str, float]:
    """Median, 99th percentile and maximum in ms of the finite ones."""
    ms = 1e3 * seconds[np.isfinite(seconds)]
    if not ms.size:
        return dict.fromkeys(("median", "p99", "max"), math.nan)
    return {"median": float(np.median(ms)), "p99": float(np.percentile(ms, 99)), "max": float(np.max(ms))}


def document(
    scenario: TrackScenario, controller: str, seed: int, model: str, result: Score, log: str | None = None
) -> dict[str, Any]:
    return {
        "scenario": scenario.name,
        "controller": controller,
        "seed": seed,
        "model": model,
        **{key: getattr(result, key) for key in Score.__dataclass_fields__},
        "log": log,
    }


def verdicts(scenario: TrackScenario, controller: str, trace: LoopTrace, found: Score) -> list[dict[str, Any]]:
    """Each check of `controller`: name, `value` in its unit (inf: never), `limit`, whether passed."""
    checks = scenario.checks.get(controller, TrackChecks())
    values: dict[str, float] = {
        "rmse_mm": 1e3 * found.tracking_rmse_m,
        "worst_mm": 1e3 * found.tracking_max_m,
        "final_mm": 1e3 * abs(found.final_error_m),
        "wall_force_mN": 1e3 * found.wall_force_max_N,
        "hard_violations": found.hard_violations,
        "lost_ticks": found.ticks["lost"],
        "failed_ticks": found.solve_ms["failed"],
        **dict(_traced(scenario, checks, trace)),
    }
    limits = {name: getattr(checks, name) for name in values}
    return [
        {"check": name, "value": value, "limit": limits[name], "passed": bool(value <= limits[name])}
        for name, value in values.items()
        if limits[name] is not None
    ]


def _traced(scenario: TrackScenario, checks: TrackChecks, trace: LoopTrace) -> Iterator[tuple[str, float]]:
    t, x = trace.rows[:, at.O_T], trace.rows[:, at.O_X]
    error = 1e3 * np.abs(x - scenario.reference.position(t))
    reference, duration = scenario.reference, scenario.duration_s
    if checks.drift_mm is not None:
        begin = scenario.control.judged_from_s if checks.drift_from_s is None else checks.drift_from_s
        yield "drift_mm", 1e3 * float(np.ptp(x[t >= begin]))
    fault = last_fault_s(scenario.instruments)
    if checks.recovered_mm is not None and fault is not None:
        yield "recovered_within_s", _back_below(t, error, checks.recovered_mm, fault)
    if checks.settled_mm is not None:
        times = [_below_for_good(t, error, checks.settled_mm, *span) for span in rests(reference, duration)]
        yield "settled_within_s", max(times, default=math.inf)
    if checks.speed_error_percent is not None:
        after = checks.speed_after_s
        long = [(begin + after, end, speed) for (begin, end), speed in legs(reference, duration) if end - begin > after]
        # the slope of the line through the positions: the ends alone would fall somewhere into a swing
        slopes = [np.polyfit(t[part], x[part], 1)[0] for b, end, _ in long for part in [(t >= b) & (t < end)]]
        errors = (100 * abs(slope / speed - 1) for slope, (*_, speed) in zip(slopes, long, strict=True))
        yield "speed_error_percent", max(errors)


def _below_for_good(t: Array, error: Array, bound: float, begin: float, end: float) -> float:
    """Seconds after `begin` from which on `error` stays below `bound` until `end`; inf where it does not."""
    inside = (t >= begin) & (t < end)
    above = np.flatnonzero(~(error[inside] < bound))
    if not above.size:
        return 0.0
    last = int(above[-1])
    return math.inf if last == np.count_nonzero(inside) - 1 else float(t[inside][last + 1] - begin)


def _back_below(t: Array, error: Array, bound: float, begin: float) -> float:
    """Seconds after `begin` until `error` stays below `bound` for `STAYING_S`; inf: never."""
    later = t >= begin
    times, above = t[later], np.flatnonzero(~(error[later] < bound))
    starts = [0, *(above + 1)]
    ends = [*times[above], math.inf]
    for start, end in zip(starts, ends, strict=True):
        if start < times.size and end >= times[start] + STAYING_S:
            return float(times[start] - begin) if start else 0.0
    return math.inf
