"""A controller node in real time: listens, starts, leads, and stops in a controlled way, whoever asks for it."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType
from typing import Any, Final

from hil.app.run.clock import Clock, Grid, Histogram
from hil.log.recorder import Recorder
from hil.nodes.controller.node import FAULTY, RUNNING, ControllerNode
from hil.nodes.controller.receive import HEARTBEAT_LOST_S
from hil.nodes.frame_map import FAULT, MOVING

LISTEN_S: Final = 2.0
LEAST_S: Final = 0.3
REST_S: Final = 0.2
COME_TO_REST_S: Final = 2.0
_MCL_CURRENT_AND_FUTURE: Final = 3


@dataclass
class Signals:
    """What the operator has said: `wanted` names the first Ctrl-C or SIGTERM; a second one ends the program as ever."""

    wanted: str = ""

    @contextmanager
    def caught(self) -> Iterator[Signals]:
        """Within it both signals only ask for a controlled stop."""
        numbers = (signal.SIGINT, signal.SIGTERM)
        before = {number: signal.getsignal(number) for number in numbers}

        def ask(number: int, _: FrameType | None) -> None:
            self.wanted = signal.Signals(number).name
            for again in numbers:
                signal.signal(again, signal.SIG_DFL)

        try:
            for number in numbers:
                signal.signal(number, ask)
            yield self
        finally:
            for number in numbers:
                signal.signal(number, before[number])


@dataclass
class Outcome:
    """How a run ended: `ended` in words, `reason` where the node stopped by itself; pacing, time that ticks took, plans
    that it `cut`.
    """

    grid: Grid
    busy: Histogram = field(default_factory=Histogram)
    cut: int = 0
    ended: str = ""
    reason: str = ""
    led: bool = False

    @property
    def well(self) -> bool:
        """Whether nothing but time or the operator ended it."""
        return not self.reason and self.led


def lead(
    node: ControllerNode, clock: Clock, duration_s: float, recorder: Recorder, signals: Signals, *, reset: bool = False
) -> Outcome:
    """Listen until the drive is heard (at most 2 s), start, lead for `duration_s`, stop, tick on until the drive is at
    rest.

    A drive that has latched a fault is led with `reset` alone: the start then acknowledges the fault.

    Overruns: a tick that begins a period late skips the points in between (`Grid`); the estimator catches up with at
    most three, after a longer pause the node stops by itself; the drive meanwhile lives on its command's time to live.
    """
    outcome = Outcome(Grid(clock, node.tick_s))
    began = _tick(node, outcome, recorder)
    now = began
    while now - began < LISTEN_S and not signals.wanted and (now - began < LEAST_S or not _heard(node, now, reset)):
        now = _tick(node, outcome, recorder)
    if _heard(node, now, reset) and not signals.wanted:
        recorder.start(now, now)
        node.start(now, now)
        outcome.led = True
        origin = now
        while node.state == RUNNING and now - origin < duration_s and not signals.wanted:
            now = _tick(node, outcome, recorder)
    outcome.reason = node.reason if node.state == FAULTY else ""
    fed = node.receiver.evidence(now).feedback_s < HEARTBEAT_LOST_S
    silent = "no heartbeat of the drive as capsule.dbc has it" if fed else "no feedback of the drive"
    missing = (_doubt(node, now, reset) or silent) + node.receiver.error_words
    missing += "; 'capsule run RIG.toml reset' acknowledges it" if missing.startswith("drive fault") else ""
    outcome.ended = outcome.reason or signals.wanted or ("time is up" if outcome.led else f"nothing to lead: {missing}")
    _come_to_rest(node, outcome, recorder, now)
    return outcome


def _doubt(node: ControllerNode, now: float, reset: bool) -> str:
    """Why the drive is not to be led, "" where it is."""
    doubt = node.receiver.doubt(now) or (
        "drive fault" if node.receiver.state == FAULT and not node.receiver.fault else ""
    )
    return "" if reset and doubt == f"drive fault {node.receiver.fault}" else doubt


def _heard(node: ControllerNode, now: float, reset: bool) -> bool:
    """Whether there is a drive to lead."""
    return (
        not _doubt(node, now, reset)
        and node.receiver.beating
        and node.receiver.evidence(now).feedback_s < HEARTBEAT_LOST_S
    )


def _come_to_rest(node: ControllerNode, outcome: Outcome, recorder: Recorder, now: float) -> None:
    """The controlled stop: off is commanded until the drive has long enough said that it does not move."""
    recorder.stop(now)
    node.stop()
    since, rested = now, now
    while now - rested < REST_S and now - since < COME_TO_REST_S:
        now = _tick(node, outcome, recorder)
        if node.receiver.state in MOVING:
            rested = now


def _tick(node: ControllerNode, outcome: Outcome, recorder: Recorder) -> float:
    now = outcome.grid.wait()
    action = node.tick(now).action
    recorder.ticked(now, action)
    outcome.cut += action.cut_after is not None
    outcome.busy.add(outcome.grid.clock.now() - now)
    return now


def _lock_memory() -> None:
    """Keep all pages of this process in memory, those to come too."""
    if ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT_AND_FUTURE):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def prepare_process(priority: int, core: int) -> list[str]:
    """Real-time hygiene of this process: what lives now is never collected, one `core`, and SCHED_FIFO of `priority`
    with memory locked, where asked for.

    Gives a sentence for each thing that the system does not allow.
    """
    gc.collect()
    gc.freeze()
    refused: list[str] = []
    wishes: list[tuple[str, Callable[[], Any]]] = []
    if core >= 0:
        wishes.append((f"core {core}", lambda: os.sched_setaffinity(0, {core})))
    if priority > 0:
        wishes.append(("memory that stays", _lock_memory))
        wishes.append(
            (f"priority {priority}", lambda: os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority)))
        )
    for what, wish in wishes:
        try:
            wish()
        except OSError as error:
            refused.append(f"{what} is not to be had: {error.strerror or error}")
    return refused
