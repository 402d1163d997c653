"""One closed loop over the simulated bus, and its trace."""

import math
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from types import FrameType
from typing import Any, Final

import can
import numpy as np

from controller.choice.choose import Progress
from controller.model.control_model import ControlModel
from controller.reference import STEP_S, Trajectory
from controller.supervision.fallback import DONE, shares
from hil.app.learn.compared import Led
from hil.app.learn.identify import Ask
from hil.app.learn.learner import Learner, Lesson
from hil.app.scenario.bus_scenario import SilScenario
from hil.app.scenario.chosen import mission_of
from hil.app.scenario.model_use import Offered
from hil.app.scenario.scenario import TrackScenario
from hil.app.sil.testbed import Bench, believed_on_bus
from hil.app.track.loop import LoopTrace
from hil.log.recorder import Recorder
from hil.nodes.frame_map import ENABLE
from hil.nodes.node import ControllerNode
from hil.simulated.plant_node import SLOT_S
from models.theta import Theta
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
_REPORTS: Final = 50  # of the progress
LEAST_S: Final = 60.0  # Wall clock that even the shortest run may take, for compilers and busy machines
LEARNING_S: Final = 7200.0  # Wall clock that a run with learning may take beyond that
Learning = Callable[[ControllerNode], Learner]
Shown = Callable[[can.Message], None]


def learning_of(scenario: SilScenario, values: Theta, ask: Ask) -> Learning:
    """Makes the learner of a run of `scenario` that begins with the parameter `values`."""
    return lambda node: Learner(
        node.estimator,
        scenario.loop.belief,
        values,
        partial(believed_on_bus, scenario),
        ask,
        scenario.learning,
        drive=node.drive,
        led=Led(mission_of(scenario.loop), node.wanted, node.tick_s),
    )


class SilTrace(LoopTrace):
    """The trace of a run over the bus. `slots` (n, 3): end of each drive slot in s, whether safe, time of the last good
    command. `steered` (ticks, 4) is `Bench.steered`; `reported` (n, 2) time and position that the localiser sent;
    `led_at` the last tick led, in s (-inf: none); `experiments_at` in s of the reference; `learned` as in a log's
    record.
    """

    def __init__(self, ticks: int, slots: int) -> None:
        super().__init__(ticks)
        self.slots, self.steered = np.zeros((ticks * slots, 3)), np.zeros((ticks, 4))

    @property
    def in_force(self) -> Trajectory:
        ticks = np.linspace(0.0, self.slots[-1, 0], len(self.steered), endpoint=False)
        return Trajectory(np.interp(np.arange(0.0, self.slots[-1, 0], STEP_S), ticks, self.steered[:, 0]))

    def end(self, bench: Bench, led: list[int], learner: Learner | None) -> None:
        """Take over what the bench knows at the end; solve times count in the ticks `led`."""
        node = bench.node
        self.finish(bench.plant.session, node.supervisor, node.estimator)
        self.lessons, self.offers = (learner.lessons, learner.offers) if learner else (list[Lesson](), list[Offered]())
        self.learned, self.experiments_at = learner.record if learner else {}, node.experiments_at
        self.frames, self.load, self.rejected = bench.frames, bench.medium.load, bench.rejected
        self.reported = np.array(sorted(bench.plant.reported)).reshape(-1, 2)
        self.unauthenticated = dict(bench.unauthenticated)
        self.operator = None if node.operator is None else node.operator.document()
        why = node.receiver.doubt(bench.time_s) or TEXT("estimate_lost" if self.lost[-1] else "not_ready")
        self.stopped_because = node.reason or ("" if led else TEXT("never_led", why=why))
        if self.stopped_because and bench.carriage is not None and bench.carriage.trouble:
            self.stopped_because += f"; {bench.carriage.trouble}"
        if node.answer.unrest and node.answer.unrest not in self.stopped_because:
            self.stopped_because = TEXT("then", ended=self.stopped_because or DONE, unrest=node.answer.unrest)
        rests = len(self.steered) - led[0] - len(led) if led else 0
        self.led_share = shares(node.answer.led + Counter(stop=rests))
        self.led_at = led[-1] * bench.tick_s if led else -math.inf
        self.ended = self.stopped_because or node.answer.not_led(node.wanted, self.health) or DONE
        self.solve_s = self.solve_s[led] if led else np.zeros(1)


def judged_loop(scenario: SilScenario, trace: SilTrace) -> TrackScenario:
    """The loop with the reference in force, where an operator, an experiment or a probe changed it."""
    if scenario.operator is None and not trace.experiments_at and not scenario.loop.control.probe:
        return scenario.loop
    return replace(scenario.loop, reference=trace.in_force)


def run_sil(
    scenario: SilScenario,
    model: ControlModel,
    controller: str,
    seed: int,
    report: Progress | None = None,
    *,
    recorder: Recorder | None = None,
    learning: Learning | None = None,
    shown: Shown | None = None,
    **more: Any,
) -> SilTrace:
    """Run `scenario` over the simulated bus; `recorder` writes the log, `learning` makes the learner, `shown` gets
    every frame; `more` are further fields of the task. Raises ValueError for a controller that cannot lead, and beyond
    the wall clock that `[bus]` allows.
    """
    bench = Bench(scenario, model, controller, seed, recorder=recorder, **more)
    loop = scenario.loop
    bench.show(shown)
    ticks = round(loop.duration_s / bench.tick_s)
    trace = SilTrace(ticks, bench.slots)
    longest_s = max(LEAST_S, scenario.bus.longest_s_per_s * loop.duration_s) + LEARNING_S * (learning is not None)
    learner = None if learning is None else learning(bench.node)
    sentence = (
        f"run must take at most {longest_s:g} s by the wall clock (bus.longest_s_per_s, at least {LEAST_S:g} s); it"
        " took longer"
    )
    began = time.perf_counter()
    led = list[int]()
    with at_most(longest_s, sentence) as look:
        bench.start()
        for k in range(ticks):
            tick = bench.begin_tick()
            trace.steered[k] = bench.steered
            if tick is not None:
                trace.note(k, tick, bench.node.task.model)
                if tick.passed.mode == ENABLE:
                    led.append(k)
                else:
                    trace.status.pop()
                if learner is not None:
                    error_m = float(tick.estimate.state[0]) - bench.node.wanted_m(tick.time_s)
                    learner.step(tick.time_s, bench.node.estimator.health, error_m)
            for number in range(bench.slots):
                at, drive = bench.slot(number), bench.plant.drive
                trace.slots[k * bench.slots + number] = at + SLOT_S, drive.safe, drive.good_at
            bench.end_tick()
            if report is not None and k % max(1, ticks // _REPORTS) == 0:
                report(controller, k / ticks)
            look()
    trace.wall_clock_s = time.perf_counter() - began
    trace.end(bench, led, learner)
    return trace


_AGAIN_S: Final = 1.0  # between further alarms


@contextmanager
def at_most(longest_s: float, sentence: str) -> Iterator[Callable[[], None]]:
    """Raise ValueError(`sentence`) after `longest_s` s: by a timer; outside the main thread in `look`."""
    end = time.monotonic() + longest_s

    def look() -> None:
        if time.monotonic() >= end:
            raise ValueError(sentence)

    def ring(_: int, __: FrameType | None) -> None:
        look()

    if threading.current_thread() is not threading.main_thread():
        yield look
        return
    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, longest_s, _AGAIN_S)
    try:
        yield look
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
