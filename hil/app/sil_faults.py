"""What came of each fault: how long until the drive was in its safe state, and whether that was safe."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from hil.app.sil_limits import limit_s
from hil.app.sil_loop import SilTrace
from hil.app.sil_scenario import SilScenario
from hil.app.track_score import violations
from hil.nodes.fault import Fault
from plant import layout as at

ROUNDING_S: Final = 1e-9


@dataclass(frozen=True)
class Outcome:
    """One fault's outcome. `safe_after_s`: from its begin until the drive was in its safe state (nan where it never had to be: the loop
    rode through); `since_good_s`: the same from the last good command frame before that. `unsafe`: the true state broke a limit, or a drive
    that moved when the fault came was in its safe state later than `sil_limits` allows, or moved again afterwards."""

    fault: Fault
    safe_after_s: float
    since_good_s: float
    unsafe: bool

    def document(self) -> dict[str, Any]:
        """The entry of the JSON's `faults`; `safe_after_ms` is null where no safe state was called for."""
        safe = None if math.isnan(self.safe_after_s) else 1e3 * self.safe_after_s
        return {"fault": self.fault.name, "at_s": self.fault.at_s, "safe_after_ms": safe, "unsafe": self.unsafe}


def outcomes(scenario: SilScenario, trace: SilTrace) -> list[Outcome]:
    """The outcome of each fault; it counts until the next one begins."""
    faults = scenario.faults
    ends = [*(f.at_s for f in faults[1:]), math.inf][: len(faults)]
    return [_outcome(scenario, trace, fault, end) for fault, end in zip(faults, ends, strict=True)]


def _outcome(scenario: SilScenario, trace: SilTrace, fault: Fault, end: float) -> Outcome:
    t, safe, good = trace.slots.T
    within = (t > fault.at_s) & (t <= end)
    reached = np.flatnonzero(within & (safe > 0))
    first = int(reached[0]) if reached.size else -1
    after_s = float(t[first] - fault.at_s) if reached.size else math.nan
    rows = trace.rows[(trace.rows[:, at.O_T] >= fault.at_s) & (trace.rows[:, at.O_T] < end)]
    unsafe = rows.shape[0] > 1 and violations(scenario.loop.truth, scenario.loop.limits, rows, scenario.loop.control.tick_s) > 0
    before = np.flatnonzero(t <= fault.at_s + ROUNDING_S)
    if before.size and not safe[before[-1]]:
        limit = limit_s(scenario.loop.kind, fault)
        watched = min(fault.duration_s, end - fault.at_s, float(t[-1]) - fault.at_s)
        late = after_s > limit + ROUNDING_S if reached.size else watched > limit
        unsafe = unsafe or late or (reached.size > 0 and not safe[first:].all())
    return Outcome(fault, after_s, float(t[first] - good[first]) if reached.size else math.nan, bool(unsafe))
