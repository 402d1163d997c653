"""A controller node in real time: it listens, starts, leads, and stops in a controlled way."""

from __future__ import annotations

import math
import signal
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from types import FrameType
from typing import Final

from controller.supervision.fallback import DONE
from hil.app.learn.learner import Learner
from hil.app.run.clock import Clock, Grid, Histogram
from hil.log.recorder import ACKNOWLEDGED, START, STOP, Recorder
from hil.nodes.frame_map import FAULT, MOVING
from hil.nodes.node import FAULTY, RUNNING, ControllerNode
from hil.nodes.operator import paused
from hil.nodes.receive import HEARTBEAT_LOST_S, SAFE_STOP
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
LISTEN_S: Final = 2.0  # at most, before a run begins
LEAST_S: Final = 0.3  # at least
REST_S: Final = 0.2  # for which the drive must rest
COME_TO_REST_S: Final = 2.0  # after which a run ends though it moves
GIVE_UP_S: Final = 5.0  # in which the drive must be enabled
RESET_S: Final = 1.0  # in which a fault must be reset
RECENT: Final = 25  # ticks whose lateness is remembered
AWAY_S: Final = 4e-3
"""A tick that is later than this is named beside the reason of a stop; a coil's command is valid for 6 ms."""
_LATE: Final = ("controller late", "drive fault", "drive left operation", "feedback lost", "drive not enabled")
"""Reasons of a stop that a controller causes when it does not get the processor."""


@dataclass
class StopSignals:
    """`wanted` names the first Ctrl-C, SIGTERM or SIGHUP; a second one ends the program. Ignored ones stay so."""

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
    """How a run ended: by id (`end`) and in words; plans `cut`; whether the drive was asked to move (`led`) and the
    estimate is `lost`; `away_s` is how late the newest ticks were done.
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
    """Listen (at most 2 s), start, lead for `duration_s` once the drive is enabled and the probe is over, stop, tick on
    until it rests. Give up where it is not enabled within `give_up_s`. Missed ticks are skipped; a `learner`
    watches.
    """
    outcome = Outcome(Grid(clock, node.tick_s))
    now = _listen(node, outcome, recorder, signals)
    if _ready(node, now, outcome, signals):
        recorder.note(now, START, math.nan)
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
        outcome.end, outcome.ended = "reset", TEXT("reset.none")
    elif outcome.end == "drive_fault" and fault:
        recorder.note(now, ACKNOWLEDGED)
        node.acknowledge()
        since = now
        while node.receiver.state == FAULT and now - since < RESET_S and not signals.wanted:
            now = _tick(node, outcome, recorder)
        stays = node.receiver.state == FAULT
        outcome.end = "not_reset" if stays else "reset"
        outcome.ended = TEXT("reset.stays" if stays else "reset.done", fault=fault)
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
    doubt, why = _doubt(node, now), ""
    if signals.wanted:
        outcome.end, outcome.ended = "cancelled", TEXT("end.cancelled", signal=signals.wanted)
    elif why := _stranger(node):
        outcome.end = "other_controller"
    elif math.isfinite(node.receiver.stopped_at) and not node.guard.dry:
        outcome.end, why = "safe_stop", SAFE_STOP
    elif doubt.startswith("drive fault"):
        outcome.end, why = "drive_fault", TEXT("end.drive_fault", fault=doubt)
    elif why := _unrest(node, now):
        outcome.end = "no_rest"
    elif not _fit(node, now):
        fed = node.receiver.evidence(now).feedback_s < HEARTBEAT_LOST_S
        why = doubt or TEXT("end.no_heartbeat" if fed else "end.no_feedback") + _refused(node)
        why += node.receiver.error_words
    else:
        return True
    outcome.ended = TEXT("end.no_lead", why=why) if why else outcome.ended
    return False


def _refused(node: ControllerNode) -> str:
    return f"; {words}" if (words := node.receiver.refused_words) else ""


def _ended(
    node: ControllerNode, now: float, outcome: Outcome, signals: StopSignals, enabled: bool, give_up_s: float
) -> tuple[str, str]:
    if node.state == FAULTY:
        other = node.reason == node.receiver.other_controller
        deaf = f"; {node.receiver.refused_words}" if node.receiver.deaf else ""
        return "other_controller" if other else node.end, _reason(node, outcome) + deaf
    if signals.wanted:
        cancelled = "cancelled", TEXT("end.cancelled", signal=signals.wanted)
        return ("operator", TEXT("end.operator", signal=signals.wanted)) if node.leads else cancelled
    if enabled:
        doubt = node.answer.not_led(node.wanted, node.estimator.health)
        return ("not_led", doubt) if doubt else ("done", DONE)
    missing = why_not_enabled(node, now, outcome.lost)
    return "gave_up", TEXT("end.gave_up", seconds=give_up_s, why=missing)


def _reason(node: ControllerNode, outcome: Outcome) -> str:
    """Why the node stopped. The clock of this loop never jumps, so a step of it is a pause."""
    away_s = max(outcome.away_s)
    if node.reason == "clock jumped" and away_s > node.tick_s:
        return TEXT("end.paused", pause=paused(away_s))
    if away_s > AWAY_S and node.reason.startswith(_LATE):
        return TEXT("end.late", reason=node.reason, ms=1e3 * away_s)
    return node.reason


def _cause(node: ControllerNode, now: float, outcome: Outcome) -> None:
    """Put a cause first that became known only while the drive came to rest."""
    twins = node.receiver.twins(now)
    if twins and twins not in outcome.ended and outcome.end in ("stopped", "gave_up", "no_drive", "sensor_or_drive"):
        outcome.ended = f"{twins}: {outcome.ended}"
        if outcome.end == "sensor_or_drive":
            outcome.end = "stopped"


def _stranger(node: ControllerNode) -> str:
    return "" if node.guard.dry else node.receiver.other_controller


def _doubt(node: ControllerNode, now: float) -> str:
    return node.receiver.doubt(now) or (
        "drive fault" if node.receiver.state == FAULT and not node.receiver.fault else ""
    )


def _unrest(node: ControllerNode, now: float) -> str:
    """That the drive moves, "" where two drives of a kind only look like it."""
    return "" if node.receiver.twins(now) else node.answer.unrest


def _fit(node: ControllerNode, now: float) -> bool:
    return not _doubt(node, now) and node.receiver.beating and node.receiver.evidence(now).feedback_s < HEARTBEAT_LOST_S


def _come_to_rest(node: ControllerNode, outcome: Outcome, recorder: Recorder, now: float) -> float:
    """Command off until the drive has reported rest for long enough; the time then."""
    recorder.note(now, STOP)
    node.stop()
    since, rested = now, now
    while now - rested < REST_S and now - since < COME_TO_REST_S:
        now = _tick(node, outcome, recorder)
        if node.receiver.state in MOVING:
            rested = now
    unrest = _unrest(node, now)
    if unrest and unrest not in outcome.ended:
        outcome.end, outcome.ended = "no_rest", TEXT("end.then", ended=outcome.ended, unrest=unrest)
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
    """What was missing at `now`; `lost`: the estimate. Refused frames are named where they are the cause."""
    receiver, fence, refused = node.receiver, node.guard.fence, _refused(node)
    seen = receiver.evidence(now)
    if seen.localisation_s == math.inf:
        return TEXT("missing.localisation") + refused
    if seen.localisation_s > fence.stop_s:
        stamped = receiver.age_s > fence.stop_s
        age = {"age": _time(receiver.age_s if stamped else seen.localisation_s), "most": _time(fence.stop_s)}
        return TEXT("missing.stamped" if stamped else "missing.newest", **age) + refused
    if seen.feedback_s > fence.feedback_s:
        return TEXT("missing.feedback", age=_time(seen.feedback_s)) + refused
    if lost:
        return TEXT("missing.estimate", **asdict(node.estimator.counts))
    state = f"state.{node.frame_map.state_name(seen.state)}"
    return TEXT(state if state in TEXT else "state.other") + refused


def _time(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds >= 1.0 else f"{1e3 * seconds:.0f} ms"
