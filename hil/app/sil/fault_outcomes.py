"""The outcome of each fault: the time until the drive was in its safe state, and whether that was safe."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from controller.drives import DRIVES
from controller.limits import Limits
from controller.signals import Array
from hil.app.scenario.bus_scenario import JogTable, SilScenario
from hil.app.sil.loop import SilTrace
from hil.app.track.score import shares, violations
from hil.drives.table import ActuatorTable
from hil.nodes.frame_map import CARRIAGE_MAP, QUICK_STOP_M_S2, frame_map_of
from hil.nodes.operator import AHEAD_M, OperatorLimits
from hil.nodes.operator_sender import CYCLE_S
from hil.simulated.faults import DRIVE, KEY, KINDS, LIES, OPERATOR, Fault
from plant import layout as at
from plant.drives import Carriage

TICKS: Final = 2  # Ticks from the first contradiction to the brake of the drive
NOT_AT_REST: Final = "does not rest"  # Words of the reason where a drive moves by itself
_ADDED: Final = ("drift", "jumped", "sway", "scaled")
"""Lies that add an offset or scale: where the drive shows no position nothing contradicts a slow one."""
WANTED, SOURCE, _, PRESSED = range(4)  # Columns of `SilTrace.steered`
BUS_S: Final = 0.02  # to the safe state after a fault of the bus itself
STUCK_S: Final = 0.05  # the same for a stuck value
PLACE_S: Final = 0.155  # 150 ms without localisation, and the delay of the next tick to the drive
_STRANGERS: Final = ("second_master", "player")


def limit_s(rig: str, fault: Fault) -> float:
    """Longest time in s from a fault (not an operator's) to the safe state; inf: the loop may ride through."""
    kind, target, frame_map = fault.kind, fault.target, frame_map_of(rig)
    unseen = (kind == "biased" and not frame_map.drive.placed) or (kind == "stuck" and frame_map.drive.shaken)
    own_s, weak = KINDS[kind].safe_s, abs(fault.amount) < KINDS[kind].value
    if weak or (kind, target) == ("delay", "localisation") or (target == "feedback" and unseen):
        return math.inf
    if not math.isnan(own_s):
        return own_s
    if kind in ("killed", "frozen") or (
        (kind in ("drop", "delay", "corrupt", "retyped") or KINDS[kind].needs == KEY) and target in ("commands", "all")
    ):
        return frame_map.stops_s
    if kind == "unreadable":
        return frame_map.seen_s if target == "controller" else frame_map.stops_s
    if kind == "bus_off" and target in ("controller", "drive"):
        return BUS_S
    if kind == "stuck" or (kind, target) == ("biased", "feedback"):
        return STUCK_S
    return frame_map.seen_s if target == "feedback" else PLACE_S


def makers_limit_s(drive: ActuatorTable, limits: Limits, fault: Fault) -> float:
    """The same for another maker's carriage, which stops as its table states and may ride through flipped bits."""
    unseen = fault.kind == "corrupt" and fault.target in ("commands", "all")
    if unseen or math.isinf(limit_s(CARRIAGE_MAP.drive.name, fault)):
        return math.inf
    seen = fault.target in ("feedback", "localisation", "localiser") or fault.kind in ("over_temperature", "late_solve")
    return drive.stops_s(limits.carriage_speed_m_s) + (limit_s(CARRIAGE_MAP.drive.name, fault) if seen else 0.0)


def hold_s(jog: JogTable, operator: OperatorLimits, fault: Fault) -> float:
    """Longest time in s from an operator's fault until the reference stands still; inf where it may go on."""
    if math.isinf(KINDS[fault.kind].safe_s) or abs(fault.amount) < KINDS[fault.kind].value:
        return math.inf
    life_s = 1e-3 * jog.life_ms
    if fault.kind == "held_back":
        apart_s = CYCLE_S + fault.amount
        seen_s = fault.amount - operator.drift_share * apart_s
        return life_s * apart_s / seen_s if seen_s > 0 else math.inf
    return CYCLE_S if fault.kind == "released" else life_s


ROUNDING_S: Final = 1e-9  # of simulated time


@dataclass(frozen=True)
class FaultOutcome:
    """The outcome of `faults` that began within a tick: s to the safe state (nan: ridden through) from the first begin
    and from the last good command. `unsafe`: a limit was broken, or the drive stopped too late or moved again. Lies
    also have the largest distance from the reference, and `why` they were unsafe.
    """

    faults: tuple[Fault, ...]
    safe_after_s: float
    since_good_s: float
    unsafe: bool
    distance_m: float = math.nan
    why: str = ""

    @property
    def fault(self) -> Fault:
        return self.faults[0]

    def document(self) -> dict[str, Any]:
        """The entry of the JSON's `faults`; `safe_after_ms` is null where no safe state was needed."""
        safe = None if math.isnan(self.safe_after_s) else 1e3 * self.safe_after_s
        name = " + ".join(fault.name for fault in self.faults)
        found = {"fault": name, "at_s": self.fault.at_s, "safe_after_ms": safe, "unsafe": self.unsafe}
        return found if math.isnan(self.distance_m) else {**found, "distance_mm": 1e3 * self.distance_m}


def outcomes(scenario: SilScenario, trace: SilTrace) -> list[FaultOutcome]:
    """The outcome of each set of faults that began within a tick, until the next one begins."""
    sets: list[list[Fault]] = []
    for fault in scenario.faults:
        if sets and fault.at_s < sets[-1][0].at_s + scenario.loop.control.tick_s - ROUNDING_S:
            sets[-1].append(fault)
        else:
            sets.append([fault])
    ends = [*(some[0].at_s for some in sets[1:]), math.inf][: len(sets)]
    return [_outcome(scenario, trace, tuple(some), end) for some, end in zip(sets, ends, strict=True)]


def limit_of(scenario: SilScenario, fault: Fault) -> float:
    """Longest time in s from a fault to the safe state; inf: the loop may ride through."""
    if fault.needs == OPERATOR and scenario.jog is not None and scenario.operator is not None:
        return hold_s(scenario.jog, scenario.operator, fault) + scenario.operator.stop_after_s + BUS_S
    if fault.kind in _STRANGERS and scenario.bus.key_file:
        return math.inf
    if scenario.drive is None:
        return limit_s(scenario.loop.kind, fault)
    return makers_limit_s(scenario.drive, scenario.loop.limits, fault)


def _outcome(scenario: SilScenario, trace: SilTrace, faults: tuple[Fault, ...], end: float) -> FaultOutcome:
    fault = faults[0]
    if any(one.kind in LIES for one in faults):
        after_s, distance_m, why = lied(scenario, trace, faults, end)
        return FaultOutcome(faults, after_s, math.nan, bool(why), distance_m, why)
    t, safe, good = trace.slots.T
    reached = np.flatnonzero((t > fault.at_s) & (t <= end) & (safe > 0))
    if reached.size and _released(scenario, trace, faults, float(t[reached[0]])):
        reached = reached[:0]
    first = int(reached[0]) if reached.size else -1
    after_s, since_good_s = (float(t[first] - at_s) if reached.size else math.nan for at_s in (fault.at_s, good[first]))
    rows = trace.rows[(trace.rows[:, at.O_T] >= fault.at_s) & (trace.rows[:, at.O_T] < end)]
    loop = scenario.loop
    unsafe = rows.shape[0] > 1 and violations(loop.truth, loop.limits, rows, loop.control.tick_s) > 0
    unsafe = unsafe or any(_missteered(scenario, trace, f, end) for f in faults if f.needs == OPERATOR)
    before = np.flatnonzero(t <= fault.at_s + ROUNDING_S)
    if before.size and not safe[before[-1]]:
        # a fault of an operator who does not steer needs no safe state
        needed = (f for f in faults if f.needs != OPERATOR or trace.steered[_tick(scenario, trace, f.at_s), SOURCE])
        limit = min((f.at_s - fault.at_s + limit_of(scenario, f) for f in needed), default=math.inf)
        lasts = max(f.end_s for f in faults) - fault.at_s
        watched = min(lasts, end - fault.at_s, float(t[-1]) - fault.at_s)
        late = after_s > limit + ROUNDING_S if reached.size else watched > limit
        pressed = trace.steered[-1, PRESSED] > trace.steered[_tick(scenario, trace, float(t[first])), PRESSED]
        again = reached.size > 0 and not safe[first:].all() and not pressed  # a press enables the drive again
        unsafe = unsafe or late or again
    return FaultOutcome(faults, after_s, since_good_s, bool(unsafe))


def _missteered(scenario: SilScenario, trace: SilTrace, fault: Fault, end: float) -> bool:
    """Whether after an operator's fault the reference left `[operator]`, followed another source, or moved on."""
    operator, jog, tick_s = scenario.operator, scenario.jog, scenario.loop.control.tick_s
    assert operator is not None
    assert jog is not None
    begin, until = _tick(scenario, trace, fault.at_s), math.ceil(min(end, trace.slots[-1, 0]) / tick_s)
    wanted, source, presses, pressed = trace.steered[begin:until].T
    if np.any(presses > pressed) or (source[0] and np.any((source != source[0]) & (source != 0))):
        return True
    led = np.flatnonzero(source)
    low, high = min(operator.lowest_m, wanted[0]) - AHEAD_M, max(operator.highest_m, wanted[0]) + AHEAD_M
    reach = operator.speed_m_s * tick_s * np.arange(wanted.size) + AHEAD_M
    if np.any((wanted[led] < low) | (wanted[led] > high) | (np.abs(wanted - wanted[0])[led] > reach[led])):
        return True
    held = fault.at_s + hold_s(jog, operator, fault) + 2 * tick_s
    last = min(end, fault.end_s, float(trace.slots[-1, 0]))
    if not source[0] or held >= last:
        return False
    return bool(np.ptp(trace.steered[math.ceil(held / tick_s) : math.floor(last / tick_s), WANTED]) > 0)


def _released(scenario: SilScenario, trace: SilTrace, faults: tuple[Fault, ...], time_s: float) -> bool:
    """Whether the drive rests at `time_s` because the operator released the switch, after the end of `faults`."""
    if scenario.jog is None or any(f.needs == OPERATOR or f.end_s >= time_s for f in faults):
        return False
    return not trace.steered[_tick(scenario, trace, time_s - scenario.loop.control.tick_s), SOURCE]


def _tick(scenario: SilScenario, trace: SilTrace, time_s: float) -> int:
    """The tick that contains `time_s`, at most the last."""
    return min(math.floor(time_s / scenario.loop.control.tick_s + ROUNDING_S), len(trace.steered) - 1)


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
    after_s = 0.0 if not moved.size else float(t[rests[0]] - begin) if rests.size else math.nan
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
