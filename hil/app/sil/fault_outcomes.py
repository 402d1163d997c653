"""What came of each fault: how long until the drive was in its safe state, and whether that was safe."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from controller.limits import Limits
from hil.app.scenario.bus_scenario import SilScenario
from hil.app.sil.loop import SilTrace
from hil.app.track.score import violations
from hil.nodes.actuators import ActuatorTable
from hil.nodes.faults.table import KINDS, Fault
from plant import layout as at

TO_LIVE_S: Final[Mapping[str, float]] = MappingProxyType({"magnetic": 0.020, "coil": 0.010, "vibro": 0.010})
"""From the last good command frame to the safe state, for each kind of rig."""
SEEN_S: Final[Mapping[str, float]] = MappingProxyType({"magnetic": 0.025, "coil": 0.010, "vibro": 0.010})
"""From the last good feedback."""
BUS_S: Final = 0.02
STUCK_S: Final = 0.05
PLACE_S: Final = 0.155
"""150 ms without localisation, and the next tick's way to the drive."""
_RIDDEN: Final = ("duplicate", "reorder", "replay")
_UNSEEN: Final = (("coil", "biased"), ("vibro", "stuck"), ("vibro", "biased"))
_OWN_S: Final[Mapping[str, float]] = MappingProxyType(
    {
        "babbling": BUS_S,
        "second_master": BUS_S,
        "player": BUS_S,
        "over_temperature": 0.5,
        "drive_reset": 0.02,
        "late_solve": 0.02,
        "clock_jump": 0.02,
    }
)


def limit_s(rig: str, fault: Fault) -> float:
    """The longest time in s from the fault's begin to the safe state, inf where the loop may ride through: doubled and
    old frames, of frames that changed places each second one is taken; a report that nothing acts on; and a fault
    weaker than its kind's own value.
    """
    kind, target = fault.kind, fault.target
    if (
        kind in _RIDDEN
        or (kind, target) == ("delay", "localisation")
        or (target == "feedback" and (rig, kind) in _UNSEEN)
    ):
        return math.inf
    if abs(fault.amount) < KINDS[kind].value:
        return math.inf
    if kind in _OWN_S:
        return _OWN_S[kind]
    if kind in ("killed", "frozen") or (
        kind in ("drop", "delay", "corrupt", "retyped") and target in ("commands", "all")
    ):
        return TO_LIVE_S[rig]
    if kind == "unreadable":
        return SEEN_S[rig] if target == "controller" else TO_LIVE_S[rig]
    if kind == "bus_off" and target in ("controller", "drive"):
        return BUS_S
    if kind == "stuck" or (kind, target) == ("biased", "feedback"):
        return STUCK_S
    return SEEN_S[rig] if target == "feedback" else PLACE_S


def makers_limit_s(drive: ActuatorTable, limits: Limits, fault: Fault) -> float:
    """The same for another maker's carriage, which comes to rest as its table states: from the last command, or from
    when the controller had to see it.
    """
    seen = fault.target in ("feedback", "localisation", "localiser") or fault.kind in ("over_temperature", "late_solve")
    return drive.stops_s(limits.carriage_speed_m_s) + (limit_s("magnetic", fault) if seen else 0.0)


ROUNDING_S: Final = 1e-9


@dataclass(frozen=True)
class Outcome:
    """What came of `faults` that began together, within a tick: one, or a set. `safe_after_s`: from the first's begin
    until the drive was in its safe state (nan where it never had to be: the loop rode through); `since_good_s`: the
    same from the last good command frame before that. `unsafe`: the true state broke a limit, or a drive that moved
    when the fault came was in its safe state later than `sil_limits` allows, or moved again afterwards.
    """

    faults: tuple[Fault, ...]
    safe_after_s: float
    since_good_s: float
    unsafe: bool

    @property
    def fault(self) -> Fault:
        """The one that began first."""
        return self.faults[0]

    def document(self) -> dict[str, Any]:
        """The entry of the JSON's `faults`; `safe_after_ms` is null where no safe state was called for."""
        safe = None if math.isnan(self.safe_after_s) else 1e3 * self.safe_after_s
        name = " + ".join(fault.name for fault in self.faults)
        return {"fault": name, "at_s": self.fault.at_s, "safe_after_ms": safe, "unsafe": self.unsafe}


def outcomes(scenario: SilScenario, trace: SilTrace) -> list[Outcome]:
    """The outcome of each fault, or of each set of faults that began within a tick; it counts until the next one
    begins.
    """
    sets: list[list[Fault]] = []
    for fault in scenario.faults:
        if sets and fault.at_s < sets[-1][0].at_s + scenario.loop.control.tick_s - ROUNDING_S:
            sets[-1].append(fault)
        else:
            sets.append([fault])
    ends = [*(some[0].at_s for some in sets[1:]), math.inf][: len(sets)]
    return [_outcome(scenario, trace, tuple(some), end) for some, end in zip(sets, ends, strict=True)]


def _limit_s(scenario: SilScenario, fault: Fault) -> float:
    if scenario.drive is None:
        return limit_s(scenario.loop.kind, fault)
    return makers_limit_s(scenario.drive, scenario.loop.limits, fault)


def _outcome(scenario: SilScenario, trace: SilTrace, faults: tuple[Fault, ...], end: float) -> Outcome:
    fault = faults[0]
    t, safe, good = trace.slots.T
    within = (t > fault.at_s) & (t <= end)
    reached = np.flatnonzero(within & (safe > 0))
    first = int(reached[0]) if reached.size else -1
    after_s = float(t[first] - fault.at_s) if reached.size else math.nan
    rows = trace.rows[(trace.rows[:, at.O_T] >= fault.at_s) & (trace.rows[:, at.O_T] < end)]
    unsafe = (
        rows.shape[0] > 1
        and violations(scenario.loop.truth, scenario.loop.limits, rows, scenario.loop.control.tick_s) > 0
    )
    before = np.flatnonzero(t <= fault.at_s + ROUNDING_S)
    if before.size and not safe[before[-1]]:
        limit = min(f.at_s - fault.at_s + _limit_s(scenario, f) for f in faults)
        lasts = max(f.end_s for f in faults) - fault.at_s
        watched = min(lasts, end - fault.at_s, float(t[-1]) - fault.at_s)
        late = after_s > limit + ROUNDING_S if reached.size else watched > limit
        unsafe = unsafe or late or (reached.size > 0 and not safe[first:].all())
    return Outcome(faults, after_s, float(t[first] - good[first]) if reached.size else math.nan, bool(unsafe))
