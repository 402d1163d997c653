"""Whether a closed-loop run keeps the limits of `[checks]`."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.app.scenario.checks import TrackChecks, last_fault_s, legs, rests
from hil.app.scenario.scenario import TrackScenario
from hil.app.track.loop import LoopTrace
from hil.app.track.score import Score
from plant import layout as at

Array = NDArray[np.float64]
STAYING_S = 1.0
"""For so long an error must stay small to count as recovered: later slip events are none of the drop-out's.
"""


def verdicts(scenario: TrackScenario, controller: str, trace: LoopTrace, found: Score) -> list[dict[str, Any]]:
    """Each check of `controller`: name, `value` in its unit (inf: never), `limit`, whether passed."""
    checks = scenario.checks.of(controller)
    values = dict(_scored(found)) | dict(_traced(scenario, checks, trace))
    limits = {name: getattr(checks, name) for name in values}
    return [
        {"check": name, "value": value, "limit": limits[name], "passed": bool(value <= limits[name])}
        for name, value in values.items()
        if limits[name] is not None
    ]


def _scored(found: Score) -> Iterator[tuple[str, float]]:
    yield "rmse_mm", 1e3 * found.tracking_rmse_m
    yield "worst_mm", 1e3 * found.tracking_max_m
    yield "final_mm", 1e3 * abs(found.final_error_m)
    yield "wall_force_mN", 1e3 * found.wall_force_max_N
    yield "hard_violations", found.hard_violations
    yield "lost_ticks", found.ticks["lost"]
    yield "failed_ticks", found.solve_ms["failed"]


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
        yield (
            "speed_error_percent",
            max(
                100 * abs(_mean_speed(t, x, begin + after, end) / speed - 1)
                for (begin, end), speed in legs(reference, duration)
                if end - begin > after
            ),
        )


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


def _mean_speed(t: Array, x: Array, begin: float, end: float) -> float:
    """Slope of the line through the positions: the ends alone would fall somewhere into a swing."""
    inside = (t >= begin) & (t < end)
    late = t[inside] - np.mean(t[inside])
    return float(np.sum(late * x[inside]) / np.sum(late**2))
