"""The outcome of lies of a localiser or a drive: how far the true capsule went, and whether that was safe."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from controller.drives import DRIVES
from hil.app.scenario.bus_scenario import SilScenario
from hil.app.sil.loop import SilTrace
from hil.app.track.score import shares
from hil.nodes.frame_map import QUICK_STOP_M_S2
from hil.simulated.faults.table import DRIVE, LIES, Fault
from plant import layout as at
from plant.drives.kinds import Carriage

Array = NDArray[np.float64]
TICKS: Final = 2
"""Ticks from the first contradiction to the brake of the drive."""
NOT_AT_REST: Final = "does not rest"
"""Words of the reason where a drive moves by itself."""
_ADDED: Final = ("drift", "jumped", "sway", "scaled")
"""Lies that add an offset or a scale to the true motion. Where the drive does not show the position, nothing
contradicts a slow one.
"""


def lied(scenario: SilScenario, trace: SilTrace, faults: Sequence[Fault], end: float) -> tuple[float, float, str]:
    """The outcome of lies that began together, up to `end`: s until the drive was safe (nan: led to the end, 0: not
    led), the largest distance in m of the true capsule from the reference until then, and why it was unsafe ("": safe).
    """
    begin = faults[0].at_s
    t, safe, _ = trace.slots.T
    within = (t > begin) & (t <= end)
    moved = np.flatnonzero(within & (safe == 0))
    first = int(moved[0]) if moved.size else int(np.argmax(within))
    rests = np.flatnonzero(within & (safe > 0) & (np.arange(t.size) >= first))
    if not moved.size:
        after_s = 0.0
    else:
        after_s = float(t[rests[0]] - begin) if rests.size else math.nan
    until = min(end, math.inf if not moved.size or math.isnan(after_s) else begin + after_s)
    rows = trace.rows[(trace.rows[:, at.O_T] >= begin) & (trace.rows[:, at.O_T] <= until)]
    if not moved.size:
        distance = np.abs(rows[:, at.O_X] - rows[:1, at.O_X])
    else:
        ticks = scenario.loop.control.tick_s * np.arange(len(trace.steered))
        distance = np.abs(rows[:, at.O_X] - np.interp(rows[:, at.O_T], ticks, trace.steered[:, 0]))
    again = bool(rests.size and moved.size and not safe[rests[0] :][within[rests[0] :]].all() and scenario.jog is None)
    if any(f.kind == "restless" for f in faults):
        why = "" if NOT_AT_REST in trace.stopped_because and trace.led_at <= begin else "led, or not reported"
    elif np.any(distance > allowed_m(scenario, trace, faults, rows)):
        why = "too far"
    else:
        why = _broken(scenario, rows) or ("moved again" if again else "")
    return after_s, float(np.max(distance, initial=0.0)), why


def allowed_m(scenario: SilScenario, trace: SilTrace, faults: Sequence[Fault], rows: Array) -> Array:
    """Allowed distance in m of the true capsule from the reference at the times of `rows`: behind a magnet its gap and
    the braking distance, else the envelope. Where no measurement contradicts the lie, also the size of the lie.
    """
    limits, drive, driven = scenario.loop.limits, scenario.loop.truth.drive, DRIVES[scenario.loop.kind]
    if isinstance(drive, Carriage):
        speed = limits.carriage_speed_m_s
        ahead = speed * TICKS * scenario.loop.control.tick_s + speed**2 / (2 * QUICK_STOP_M_S2)
        allowed = np.full(len(rows), limits.gap_share * drive.gap_limit_m + ahead)
        believed = False
    else:
        around_m = (limits.envelope_m or driven.around_m) + driven.goes_on_m
        foreign_m = max((2 * f.amount + driven.tracked_m for f in faults if f.kind == "foreign"), default=0.0)
        allowed = np.full(len(rows), max(around_m, foreign_m))
        believed = all(f.kind in _ADDED for f in faults)
    if believed or {DRIVE, "localisation"} <= {f.target for f in faults if f.kind in LIES}:
        allowed = np.maximum(allowed, _size(trace, rows) + driven.tracked_m)
    return allowed


def _size(trace: SilTrace, rows: Array) -> Array:
    """The largest difference in m so far of reported and true position, at the times of `rows`."""
    reported = trace.reported[np.isfinite(trace.reported[:, 1])]
    if not reported.size:
        return np.zeros(len(rows))
    true = np.interp(reported[:, 0], trace.rows[:, at.O_T], trace.rows[:, at.O_X])
    largest = np.concatenate([[0.0], np.maximum.accumulate(np.abs(reported[:, 1] - true))])
    return np.asarray(largest[np.searchsorted(reported[:, 0], rows[:, at.O_T], side="right")])


def _broken(scenario: SilScenario, rows: Array) -> str:
    """The limit that the true state broke, "" for none; a magnet that lost the capsule breaks none."""
    truth, limits = scenario.loop.truth, scenario.loop.limits
    if len(rows) < 2:
        return ""
    used = {name: share for name, share in shares(truth, limits, rows).items() if name != "gap"}
    if truth.drive.straight:
        used["travel"] = np.abs(rows[:, at.O_DRIVE]) / limits.travel_m
    return next((name for name, share in used.items() if np.any(share > 1 + 1e-9)), "")
