"""A controller node in real time: listens, starts, leads, and stops in a controlled way, whoever asks for it."""

from __future__ import annotations

import math
import signal
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType
from typing import Final

from controller.supervision.fallback import DONE
from hil.app.learn.learner import Learner
from hil.app.run.clock import Clock, Grid, Histogram
from hil.log.recorder import Recorder
from hil.nodes.controller.lateness import paused
from hil.nodes.controller.node import FAULTY, RUNNING, ControllerNode
from hil.nodes.controller.receive import HEARTBEAT_LOST_S
from hil.nodes.frame_map import BOOT, FAULT, MOVING, SELF_TEST, STANDBY, STOPPING, WAITING

LISTEN_S: Final = 2.0  # at most, before a run begins
LEAST_S: Final = 0.3  # at least
REST_S: Final = 0.2  # for which the drive must rest
COME_TO_REST_S: Final = 2.0  # after which a run ends though it moves
GIVE_UP_S: Final = 5.0  # in which the drive must be enabled
RESET_S: Final = 1.0  # in which a fault must be reset
RECENT: Final = 25  # ticks whose lateness is remembered
AWAY_S: Final = 4e-3
"""By so much a tick may come late without being named beside the reason of a stop: a coil's command lives for 6 ms."""
_LATE: Final = ("controller late", "drive fault", "drive left operation", "feedback lost", "drive not enabled")
"""Reasons that a controller which does not get the processor brings about."""
_STATES: Final = {
    BOOT: "boots",
    SELF_TEST: "is in its self test",
    STANDBY: "stays in standby",
    WAITING: "is ready, and was not enabled",
    STOPPING: "is in its quick stop",
    FAULT: "is in fault",
}


@dataclass
class StopSignals:
    """`wanted` names the first Ctrl-C, SIGTERM or SIGHUP; a second one ends the program; what was ignored stays so."""

    wanted: str = ""

    @contextmanager
    def caught(self) -> Iterator[StopSignals]:
        """Within it these signals only ask for a controlled stop."""
        before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
        before = {number: handler for number, handler in before.items() if handler != signal.SIG_IGN}

        def ask(number: int, _: FrameType | None) -> None:
            self.wanted = signal.Signals(number).name
            for again in before:
                signal.signal(again, signal.SIG_DFL)

        try:
            for number in before:
                signal.signal(number, ask)
            yield self
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


@dataclass
class Outcome:
    """How a run ended: `end` (of `RUN_ENDS`) and in words; plans `cut`; whether the drive was asked to move (`led`) and
    the estimate `lost`; `away_s`: how late the newest ticks were done.
    """

    grid: Grid
    busy: Histogram = field(default_factory=Histogram)
    cut: int = 0
    end: str = "no_drive"
    ended: str = ""
    led: bool = False
    lost: bool = True
    done_s: float = math.inf
    away_s: deque[float] = field(default_factory=lambda: deque([0.0], maxlen=RECENT))


def lead(
    node: ControllerNode,
    clock: Clock,
    duration_s: float,
    recorder: Recorder,
    signals: StopSignals,
    give_up_s: float = GIVE_UP_S,
    learner: Learner | None = None,
) -> Outcome:
    """Listen (at most 2 s), start, lead for `duration_s` from when the drive is enabled and the probe is over, stop,
    tick on until it rests; given up where it is not enabled within `give_up_s`. Ticks missed are skipped; a `learner`
    looks on.
    """
    outcome = Outcome(Grid(clock, node.tick_s))
    now = _listen(node, outcome, recorder, signals)
    if _ready(node, now, outcome, signals):
        recorder.start(now, math.nan)
        node.start(now)
        began, follows = now, now if node.guard.dry else math.nan
        enabled = not math.isnan(follows)
        while node.state == RUNNING and not signals.wanted:
            now = _tick(node, outcome, recorder, learner)
            enabled = enabled or node.enabled
            follows = now if math.isnan(follows) and node.follows else follows
            if now - follows >= duration_s or (not enabled and now - began >= give_up_s):
                break
        outcome.led = node.leads
        outcome.end, outcome.ended = _ended(node, now, outcome, signals, enabled, give_up_s)
    _cause(node, _come_to_rest(node, outcome, recorder, now), outcome)
    return outcome


def reset(node: ControllerNode, clock: Clock, recorder: Recorder, signals: StopSignals) -> Outcome:
    """Listen until the drive is heard and acknowledge its latched fault; nothing is enabled."""
    outcome = Outcome(Grid(clock, node.tick_s))
    now = _listen(node, outcome, recorder, signals, faulty=True)
    fault = node.receiver.fault
    if _ready(node, now, outcome, signals) and not fault:
        outcome.end, outcome.ended = "reset", "the drive has no fault to acknowledge"
    elif outcome.end == "drive_fault" and fault:
        recorder.acknowledge(now)
        node.acknowledge()
        since = now
        while node.receiver.state == FAULT and now - since < RESET_S and not signals.wanted:
            now = _tick(node, outcome, recorder)
        stays = node.receiver.state == FAULT
        outcome.end = "not_reset" if stays else "reset"
        told = "stays: its cause is still there" if stays else "is acknowledged; the drive stands by"
        outcome.ended = f"drive fault {fault} {told}"
    _come_to_rest(node, outcome, recorder, now)
    return outcome


def _listen(
    node: ControllerNode, outcome: Outcome, recorder: Recorder, signals: StopSignals, *, faulty: bool = False
) -> float:
    """Tick until there is a drive to lead (or, `faulty`, with a named fault), 2 s at most; the time then."""

    def heard(now: float) -> bool:
        named = faulty and node.receiver.fault > 0 and node.receiver.state == FAULT
        return named or bool(_stranger(node)) or (_fit(node, now) and not _unrest(node, now))

    node.receiver.skip()
    began = now = _tick(node, outcome, recorder)
    while now - began < LISTEN_S and not signals.wanted and (now - began < LEAST_S or not heard(now)):
        now = _tick(node, outcome, recorder)
    return now


def _ready(node: ControllerNode, now: float, outcome: Outcome, signals: StopSignals) -> bool:
    """Whether there is a drive to lead; else why not, in `outcome`."""
    doubt = _doubt(node, now)
    if signals.wanted:
        outcome.end, outcome.ended = "cancelled", f"{signals.wanted} before the drive was enabled"
    elif other := _stranger(node):
        outcome.end, outcome.ended = "other_controller", f"nothing to lead: {other}"
    elif doubt.startswith("drive fault"):
        outcome.end = "drive_fault"
        outcome.ended = f"nothing to lead: {doubt}; 'capsule run RIG.toml reset' acknowledges it"
    elif unrest := _unrest(node, now):
        outcome.end, outcome.ended = "no_rest", f"nothing to lead: {unrest}"
    elif not _fit(node, now):
        fed = node.receiver.evidence(now).feedback_s < HEARTBEAT_LOST_S
        silent = "no heartbeat of the drive as capsule.dbc has it" if fed else "no feedback of the drive"
        refused = f"; {words}" if not doubt and (words := node.receiver.refused_words) else ""
        outcome.ended = f"nothing to lead: {doubt or silent}{refused}{node.receiver.error_words}"
    else:
        return True
    return False


def _ended(
    node: ControllerNode, now: float, outcome: Outcome, signals: StopSignals, enabled: bool, give_up_s: float
) -> tuple[str, str]:
    """How a run ended that had a drive to lead, and in words."""
    if node.state == FAULTY:
        other = node.reason == node.receiver.other_controller
        deaf = f"; {node.receiver.refused_words}" if node.receiver.deaf else ""
        return "other_controller" if other else node.end, _reason(node, outcome) + deaf
    if signals.wanted:
        return ("operator", signals.wanted) if node.leads else ("cancelled", f"{signals.wanted} before it was enabled")
    if enabled:
        doubt = node.answer.not_led(node.wanted, node.estimator.health)
        return ("not_led", doubt) if doubt else ("done", DONE)
    missing = why_not_enabled(node, now, outcome.lost)
    return "gave_up", f"gave up: the drive was not enabled within {give_up_s:g} s: {missing}"


def _reason(node: ControllerNode, outcome: Outcome) -> str:
    """Why the node stopped, in the light of this loop's clock, which never jumps: a step of it is a pause."""
    away_s = max(outcome.away_s)
    if node.reason == "clock jumped" and away_s > node.tick_s:
        return f"{paused(away_s)}, in which nothing was heard"
    if away_s > AWAY_S and node.reason.startswith(_LATE):
        return f"{node.reason}; the controller itself was late by {1e3 * away_s:.0f} ms"
    return node.reason


def _cause(node: ControllerNode, now: float, outcome: Outcome) -> None:
    """Put the cause first that became known only while the drive came to rest, or from the clock of this loop."""
    twins = node.receiver.twins(now)
    if twins and twins not in outcome.ended and outcome.end in ("stopped", "gave_up", "no_drive", "sensor_or_drive"):
        outcome.end = "stopped" if outcome.end == "sensor_or_drive" else outcome.end
        outcome.ended = f"{twins}: {outcome.ended}"


def _stranger(node: ControllerNode) -> str:
    """That another controller speaks, where that matters: to one that only listens it does not."""
    return "" if node.guard.dry else node.receiver.other_controller


def _doubt(node: ControllerNode, now: float) -> str:
    """Why the drive is not to be led, "" where it is."""
    return node.receiver.doubt(now) or (
        "drive fault" if node.receiver.state == FAULT and not node.receiver.fault else ""
    )


def _unrest(node: ControllerNode, now: float) -> str:
    """That the drive does not rest, "" where two of a kind make it seem so."""
    return "" if node.receiver.twins(now) else node.answer.unrest


def _fit(node: ControllerNode, now: float) -> bool:
    return not _doubt(node, now) and node.receiver.beating and node.receiver.evidence(now).feedback_s < HEARTBEAT_LOST_S


def _come_to_rest(node: ControllerNode, outcome: Outcome, recorder: Recorder, now: float) -> float:
    """Command off until the drive has long enough said that it does not move; the time then."""
    recorder.stop(now)
    node.stop()
    since, rested = now, now
    while now - rested < REST_S and now - since < COME_TO_REST_S:
        now = _tick(node, outcome, recorder)
        if node.receiver.state in MOVING:
            rested = now
    unrest = _unrest(node, now)
    if unrest and unrest not in outcome.ended:
        outcome.end, outcome.ended = "no_rest", f"{outcome.ended}; then {unrest}"
    return now


def _tick(node: ControllerNode, outcome: Outcome, recorder: Recorder, learner: Learner | None = None) -> float:
    now = outcome.grid.wait()
    tick = node.tick(now)
    recorder.ticked(now, tick.action)
    if learner is not None and node.enabled:
        error_m = float(tick.estimate.state[0]) - node.wanted_m(tick.time_s)
        learner.step(tick.time_s, node.estimator.health, error_m)
    outcome.cut += tick.action.cut_after is not None
    done = outcome.grid.clock.now()
    outcome.busy.add(done - now)
    outcome.lost = tick.estimate.lost
    outcome.away_s.append(done - outcome.done_s - node.tick_s)
    outcome.done_s = done
    return now


def why_not_enabled(node: ControllerNode, now: float, lost: bool) -> str:
    """What was missing at `now`; `lost` says whether the estimate was. Refusals are told where they are the cause."""
    receiver, fence = node.receiver, node.guard.fence
    seen = receiver.evidence(now)
    refused = f"; {words}" if (words := receiver.refused_words) else ""
    if seen.localisation_s == math.inf:
        return f"no localisation that counts has been heard{refused}"
    if seen.localisation_s > fence.stop_s:
        told = receiver.told_s > fence.stop_s
        came = f"localisation is told as {_ms(receiver.told_s)} old" if told else ""
        came = came or f"the newest localisation came {_ms(seen.localisation_s)} ago"
        return f"{came}, and may be {_ms(fence.stop_s)} old{refused}"
    if seen.feedback_s > fence.feedback_s:
        return f"the newest feedback of the drive is {_ms(seen.feedback_s)} old{refused}"
    if lost:
        return f"the estimate is lost: {_why_lost(node)}"
    return f"the drive {_STATES.get(seen.state, 'did not become ready')}{refused}"


def _why_lost(node: ControllerNode) -> str:
    counts = node.estimator.counts
    return (
        f"of the localisations {counts.accepted} were as expected, {counts.outliers} were not, {counts.unusable} came"
        " too late to be used"
    )


def _ms(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds >= 1.0 else f"{1e3 * seconds:.0f} ms"
