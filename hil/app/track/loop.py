"""One closed loop in simulated time: plant session, estimator, supervised controller, tick by tick."""

import math
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from itertools import dropwhile
from types import MappingProxyType

import numpy as np

from controller.choice.choose import Progress
from controller.closed_loop import Asked, ClosedLoop, Tick
from controller.drives import DRIVES
from controller.estimator.base import Counts
from controller.height import choose_height, values_at
from controller.model.control_model import ControlModel, control_model
from controller.monitor import Health
from controller.signals import Measurement
from controller.supervision.fallback import Event
from controller.supervision.model_switch import ModelSwitch, Offer
from controller.supervision.supervisor import Supervisor
from controller.vibro.cycles import in_time
from hil.app.scenario.scenario import TrackScenario
from models.rigs.rig import at_height
from models.theta import Theta
from plant.drives import TrueMagnetPair
from plant.rig import Truth
from plant.session import Session

_REPORTS = 50  # of the progress


class LoopTrace:
    """The trace of a run, one entry for each tick. `rows` is the true state (`plant.layout`), `health` the last state
    of the monitor, `truth` the true rig, `halted` why the supervisor stopped, `first` the controller asked for.
    """

    def __init__(self, ticks: int) -> None:
        self.time_s, self.command, self.position_m, self.wall_m = (np.full(ticks, np.nan) for _ in range(4))
        self.disturbance_N, self.solve_s, self.estimate_s = (np.full(ticks, np.nan) for _ in range(3))
        self.lost = np.zeros(ticks, dtype=bool)
        self.status, self.active, self.events = list[str](), list[str](), list[Event]()
        self.rows = np.zeros((0, 9))
        self.counts, self.health, self.switched = Counts(), Health(), list[tuple[float, str]]()
        self.taken_at, self.wall_clock_s = math.nan, 0.0
        self.truth: Truth | None = None
        self.halted = self.first = ""

    @property
    def led(self) -> Counter[str]:
        """Ticks by who led, from the first that was led."""
        return Counter(dropwhile(lambda name: name == "stop", self.active))

    def note(self, k: int, tick: Tick, model: ControlModel) -> None:
        self.time_s[k], self.command[k] = tick.time_s, tick.action.command
        self.position_m[k], self.disturbance_N[k] = tick.estimate.state[0], tick.estimate.disturbance_N
        if "u" in model.states:
            self.wall_m[k] = tick.estimate.state[model.index("u")]
        self.lost[k] = tick.estimate.lost
        self.status.append(tick.action.status)
        self.active.append(tick.active)
        self.estimate_s[k], self.solve_s[k] = tick.seconds

    def finish(self, session: Session, supervisor: Supervisor, estimator: ModelSwitch) -> None:
        self.rows, self.events = np.concatenate(session.rows), list(supervisor.events)
        self.counts, self.taken_at, self.health = estimator.counts, estimator.taken_at, estimator.health
        self.switched = estimator.switched


def believed_model(scenario: TrackScenario, values: Theta, before: ControlModel | None = None) -> ControlModel:
    """The control model of the believed rig, with the `values` of a stage of a model file."""
    drive = DRIVES[scenario.kind]
    belief, numbers = in_time(scenario.belief, values) if drive.shaken else (scenario.belief, values)
    height = _height_m(scenario, numbers, before)
    if height is not None:
        belief, numbers = at_height(belief, height), values_at(belief, numbers, height)
    return control_model(belief, numbers, scenario.control.tick_s, driven=drive.simulated)


def _height_m(scenario: TrackScenario, values: Theta, before: ControlModel | None) -> float | None:
    """The magnet's height in m where it is commanded: that of the model `before`, else chosen anew."""
    if before is not None and before.rig.magnets is not None:
        return before.rig.magnets.height_m
    times = np.arange(0.0, scenario.duration_s, scenario.control.tick_s)
    fastest = float(np.max(np.abs(scenario.reference.speed(times))))
    chosen = choose_height(scenario.belief, values, fastest)
    return None if chosen is None else chosen.height_m


def _lifted(scenario: TrackScenario, model: ControlModel) -> Truth:
    drive, stated, asked = scenario.truth.drive, scenario.belief.magnets, model.rig.magnets
    if not isinstance(drive, TrueMagnetPair) or stated is None or asked is None:
        return scenario.truth
    return replace(scenario.truth, drive=replace(drive, height_m=drive.height_m + asked.height_m - stated.height_m))


class _Plant:
    """The plant as the world of a loop."""

    def __init__(self, session: Session) -> None:
        self.session = session

    def advance(self, command: float, until_s: float) -> list[Measurement]:
        return [Measurement(r.channel, r.value, r.stamp_s) for r in self.session.advance(command, until_s)]


def run_loop(
    scenario: TrackScenario,
    model: ControlModel,
    controller: str,
    seed: int,
    report: Progress | None = None,
    *,
    offer: Offer | None = None,
    others: Mapping[str, ControlModel] = MappingProxyType({}),
) -> LoopTrace:
    """Run `scenario`: in each tick estimate, command through supervisor and limits, plant. The model on `offer` takes
    over at a rest, one of the `others` once the model is broken. Raises ValueError for a controller that cannot lead
    this rig.
    """
    noise_m, estimator = scenario.instruments.localisation.std, scenario.control.estimator
    loop = ClosedLoop(Asked(scenario.reference, scenario.limits, noise_m, estimator), model, controller, offer, others)
    truth = _lifted(scenario, model)
    plant = _Plant(Session(truth, scenario.instruments, seed, loop.supervisor.issued.command))
    ticks = round(scenario.duration_s / scenario.control.tick_s)
    trace = LoopTrace(ticks)
    began = time.perf_counter()
    for k, tick in enumerate(loop.run(plant, ticks)):
        trace.note(k, tick, model)
        if report is not None and k % max(1, ticks // _REPORTS) == 0:
            report(controller, k / ticks)
    trace.wall_clock_s = time.perf_counter() - began
    trace.finish(plant.session, loop.supervisor, loop.estimator)
    trace.truth, trace.halted, trace.first = truth, loop.supervisor.halted, loop.supervisor.first
    return trace
