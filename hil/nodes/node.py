"""The controller as a node on the bus: received frames, estimate, supervised controller, guard, sent frames."""

import math
import time
from collections import deque
from dataclasses import dataclass
from typing import Final

import can
import numpy as np

from controller.closed_loop import Tick
from controller.drives import envelope_of
from controller.limits import Envelope
from controller.reference import Excursion, Experiment
from controller.signals import Action, Array, Estimate, Measurement, Reference
from controller.supervision.breakaway import resistance_of
from controller.supervision.contradiction import CONTRADICT
from controller.supervision.probe import Probe
from hil.nodes import frame_map as wire
from hil.nodes import view
from hil.nodes.frame_map import Observer, answer_of, frame_map_of, heartbeat
from hil.nodes.guard import GUARD_REASON, STOP_PERIOD_S, Evidence, Fence, Guard, Passed
from hil.nodes.operator import STATUS, STATUS_S, Operator, gap_words, paused
from hil.nodes.plausibility import Onlooker, Plausibility
from hil.nodes.receive import BY_OPERATOR, SAFE_STOP, FrameReceiver
from hil.nodes.task import Task


@dataclass(frozen=True, slots=True)
class NodeTick(Tick):
    """The result of one tick of a node for `time_s`: also what the guard passed, and the node's state."""

    passed: Passed
    state: int


@dataclass(frozen=True, slots=True)
class Shifted:
    """A reference that begins at `origin_s` of the node's clock, shifted by `shift_m`."""

    path: Reference
    origin_s: float
    shift_m: float = 0.0

    def position(self, t: Array) -> Array:
        return self.path.position(t - self.origin_s) + self.shift_m

    def speed(self, t: Array) -> Array:
        return self.path.speed(t - self.origin_s)


IDLE, RUNNING, HALTING, FAULTY = 1, 2, 3, 4  # states of the node, in the numbers of its heartbeat
HEARTBEAT_S: Final = 0.02  # period
_LAG_S: Final = 8e-3  # Tolerated lag of a drive's report behind its command; `Driven.follow` applies beyond it
_RESTS_M_S: Final = 1e-4  # maximum speed of a reference at rest
_REST_S: Final = 0.05  # A reference rests where it is this slow for so long before and after
OTHER_CONTROLLER: Final = 9  # `Reason` of a SafeStop
_CROWDED_S: Final = 0.1  # after the last frame of another controller
_ROUNDING_S: Final = 1e-6  # of a frame's time to live
GRID_SLACK: Final = 1e-3  # share of a tick by which rounding may put a time before its grid point


class ControllerNode:
    """`tick(now)` runs once per tick of the model: it sends SYNC, reads the bus, and computes the command for the tick
    that begins with the *next* SYNC, at which the drive applies it. It never raises, never sleeps and takes bounded
    time.

    `now` is in s of the clock that stamps received messages. The node begins idle. `start` takes the drive through
    ready to enabled, `stop` back. A stop by the node itself is latched with its `reason` until `start`, which first
    acknowledges a latched fault of the drive; `acknowledge` does only that. Another controller on the bus stops the
    node; it sends a SafeStop to all drives as long as the other one speaks. An operator's safe stop stops it, too.

    Missed ticks are made up for while the last command is valid; after a longer step of the clock the node stops
    (`gap_words`). With an `operator` the reference is the task's own until an operator takes charge; when nobody has
    been in charge for a while the drive is stopped. `observer` gets every received and sent frame.
    """

    def __init__(self, task: Task, bus: can.BusABC, *, observer: Observer | None = None, dry_run: bool = False) -> None:
        """Raises ValueError for a rig without a drive on the bus, and for a controller that does not fit it."""
        self.task, self.frame_map = task, frame_map_of(task.model.drive.name)
        self._x = task.model.index("x")
        self.envelope: Envelope = envelope_of(task.model.drive, task.limits)
        self.supervisor, self.estimator = task.built(self.envelope)
        self._own, self.wanted = self.supervisor, self.supervisor.first
        self.tick_s = task.model.tick_s
        self.operator = None if task.operator is None else Operator(task.operator)
        self.receiver = FrameReceiver(bus, self.frame_map, self.tick_s, observer, self.operator)
        fence = Fence.of(self.envelope, self.frame_map, self.tick_s)
        self.guard = Guard(bus, self.frame_map, fence, dry=dry_run, observe=observer)
        self.state, self.reason, self.end = IDLE, "", "stopped"
        resistance = resistance_of(task.model, self.envelope)
        self.answer = Onlooker(self.envelope, self.frame_map.drive.rests, self.tick_s, task.seen_noise_m, resistance)
        self._probe: Probe | None = None
        self._probed = False
        lag_ticks = 2 + math.ceil(_LAG_S / self.tick_s)
        self._plausibility = Plausibility(self.frame_map.drive.follow, task.seen_noise_m, task.resolution_m, lag_ticks)
        self._reference: Reference = task.reference
        self._experiments = deque(task.experiments)
        self.experiments_at: list[float] = []
        self._began = self._last = -math.inf
        self._sent_at: dict[str, float] = {}
        self._surprise = math.nan
        self._origin, self._index = 0.0, 0
        self._number = 0
        self._led = self._rested = False
        self._here = False
        self._enabled_s, self._probe_ends = -math.inf, math.inf
        self._acknowledge = 0
        self._before = Passed(0.0, 0.0, wire.OFF)

    def start(self, now: float, origin_s: float | None = None) -> None:
        """Start as the operator requests; ends a latched stop.

        The reference begins at the capsule's position when the drive is enabled; the drive's rate or range then grows
        from its first limits (`Fence.after`). With `origin_s`, for benches, the reference begins at that time and at
        its own position, with full limits.
        """
        self._here = origin_s is None
        self._begin_reference(now if origin_s is None else origin_s)
        self.state, self.reason, self.end, self._led, self._rested = RUNNING, "", "stopped", False, False
        self._probe, self._probed = None, not self.task.probe
        if self.operator is not None:
            self.operator.begin()
        self._enabled_s = -math.inf
        self.receiver.foreign.clear()
        self.receiver.stopped_at = -math.inf
        self._plausibility.settle(self.estimator.counts.restarts)
        self.acknowledge()

    def acknowledge(self) -> None:
        """Acknowledge the latched fault of the drive, if it has reported one; nothing else."""
        self._acknowledge = 2 if self.receiver.fault else 0

    @property
    def leads(self) -> bool:
        """Whether the drive was commanded to move since the last start."""
        return self._led or self._rested

    @property
    def enabled(self) -> bool:
        return self._led and self.receiver.state in wire.MOVING

    @property
    def follows(self) -> bool:
        """Whether the drive is enabled and the reference has begun, after any probe."""
        return self.enabled and self._probed

    def wanted_m(self, at_s: float) -> float:
        """The position of the reference in m at a time of the node's clock."""
        return view.sampled(self._reference, at_s)[0]

    def _begin_reference(self, origin_s: float, position_m: float | None = None) -> None:
        shift_m = 0.0 if position_m is None else position_m - view.sampled(self.task.reference, 0.0)[0]
        self._reference = Shifted(self.task.reference, origin_s, shift_m)
        self.estimator.begin(origin_s)

    def drive(self, experiment: Experiment) -> None:
        """Insert an experiment at the reference's first rest after `at_s`, if it stays within the travel."""
        self._experiments.append(experiment)

    def stop(self, reason: str = "operator") -> None:
        """A controlled stop: the drive goes to its safe state and off, until `start`."""
        if self.state == RUNNING:
            self.state, self.reason = HALTING, reason

    def tick(self, now: float, solved: bool = True) -> NodeTick:
        """One tick at `now` in s; a non-finite one is a clock jump. With `solved` False the solution came too late."""
        began = time.perf_counter()
        if not math.isfinite(now):
            now = self._last + self.tick_s if math.isfinite(self._last) else 0.0
            self._fail("clock jumped")
        missed = self._missed(now)
        self._speak(now)
        arrived = self.receiver.listen(now)
        estimate = self._estimated(now, arrived, missed)
        self.answer.believe(now, self._position(estimate), self.estimator.counts.followed, arrived)
        middle = time.perf_counter()
        self._steer(now, estimate)
        evidence = self.receiver.evidence(now)
        self._judge(now, arrived, evidence)
        mode = self._mode(evidence, estimate)
        action = self._act(now, mode, estimate) if solved else Action(math.nan, "late")
        end = time.perf_counter()
        self._before = self.guard.sent
        if mode == wire.READY and self.receiver.challenge >= 0:
            answer = answer_of(self.receiver.challenge, self.frame_map.target)
            self.guard.send("EnableAnswer", {"Target": self.frame_map.target, "Answer": answer}, now)
            self.receiver.challenge = -1
        since_s = now - max(self._enabled_s, self.answer.cautious_s)
        out = self.guard.command(now, action.command, mode, evidence, since_s)
        if out.mode == wire.QUICK_STOP:
            self._fail(out.reason)
        if out.mode == wire.ENABLE:
            self.answer.led[self.supervisor.active] += 1
        self._stop_all(now)
        self._show(now, estimate)
        self._last = now
        seconds = middle - began, end - middle
        return NodeTick(now + self.tick_s, estimate, action, self.supervisor.active, seconds, out, self.state)

    def _speak(self, now: float) -> None:
        """Send SYNC, heartbeat, the monitor's verdict, the operator's status, the acknowledgement of a fault."""
        if self._began == -math.inf:
            self._began = now
        self.guard.send("Sync", {"Tick": self._number % (1 << 32), "Period_s": self.tick_s}, now)
        if self._due("ControllerHeartbeat", HEARTBEAT_S, now):
            self.guard.send("ControllerHeartbeat", heartbeat(self.state, now - self._began), now)
        if self._due("ModelHealth", view.HEALTH_S, now):
            self.guard.send("ModelHealth", view.health_values(self.estimator.health, self._began), now)
        if self.operator is not None and self._due(STATUS, STATUS_S, now):
            self.guard.send(STATUS, self.operator.status(now, self._reference, self.state == RUNNING), now)
        if self._acknowledge:
            self._acknowledge -= 1
            self.guard.send("DriveReset", {"Target": self.frame_map.target, "Code": self.receiver.fault}, now)
            if not self._acknowledge:
                self.receiver.fault = 0

    def _due(self, name: str, period_s: float, now: float) -> bool:
        """Whether the frame `name` is due at `now` by its period; it then counts as sent."""
        due = not 0 <= now - self._sent_at.get(name, -math.inf) < period_s - 0.5 * self.tick_s
        if due:
            self._sent_at[name] = now
        return due

    def _show(self, now: float, estimate: Estimate) -> None:
        self._surprise = estimate.surprise if math.isfinite(estimate.surprise) else self._surprise
        if not self._due("BelievedMotion", view.VIEW_S, now):
            return
        wanted = view.sampled(self._reference, now + self.tick_s)
        model, follows = self.estimator.model, self.state == RUNNING and self._led
        self.guard.send("BelievedMotion", view.motion_values(model, estimate, self._surprise), now)
        self._surprise = math.nan
        if (forces := view.force_values(model, estimate, self._in_force, now)) is not None:
            self.guard.send("BelievedForces", forces, now)
        self.guard.send("WantedMotion", view.wanted_values(*wanted, follows, self.estimator.switches), now)

    def _estimated(self, now: float, arrived: list[Measurement], missed: int) -> Estimate:
        """The estimate for the begin of the next tick, with the command in force until then, after `missed` ticks."""
        for m in arrived:
            if m.channel == "position_m":
                self._plausibility.saw(m.value)
        moved = self.receiver.state in wire.MOVING and self.guard.sent.mode == self._before.mode == wire.ENABLE
        if moved:  # in the previous tick
            self._plausibility.tick(self._before.value, [m.value for m in arrived if m.channel != "position_m"])
        if missed < 0:
            self.estimator.reset(now, self._in_force)
            self._fail(gap_words(now - self._last, self.tick_s, self.receiver.feedbacks, self.receiver.frames))
        for k in range(missed, 0, -1):
            then = now + (1 - k) * self.tick_s
            self.estimator.observe(then, self._in_force, [m for m in arrived if m.stamp_s <= then])
            arrived = [m for m in arrived if m.stamp_s > then]
        return self.estimator.observe(now + self.tick_s, self._in_force, arrived)

    def _missed(self, now: float) -> int:
        """The count of grid ticks that were missed just before this one. After a step of the clock backwards, or beyond
        the time to live of the last command, it is -1 and the grid begins anew. A tick late by less than a period
        counts as its own. The number of SYNC follows the time and never decreases.
        """
        if not math.isfinite(self._last):
            self._origin, self._index = now, 0
            return 0
        index, before = math.floor((now - self._origin) / self.tick_s + GRID_SLACK), self._index
        if index > before and now - self._last <= 1e-3 * self.frame_map.life_ms(self.guard.sent.rate) + _ROUNDING_S:
            self._index = index
            self._number += index - before
            return index - before - 1
        self._number += max(math.ceil((now - self._last) / self.tick_s - GRID_SLACK), 1)
        self._origin, self._index = now, 0
        return -1

    def _position(self, estimate: Estimate) -> float:
        return float(estimate.state[self._x])

    @property
    def _in_force(self) -> float:
        """The command that the drive applies with this tick's SYNC; its reported value while it is disabled."""
        return self.guard.sent.value if self.guard.sent.mode == wire.ENABLE else self.receiver.report

    def _stop_all(self, now: float) -> None:
        """SafeStop: to all drives beside another controller, to the own one if restless or stopped by an operator."""
        crowded = self.state == FAULTY and 0 <= now - self.receiver.foreign_at < _CROWDED_S
        stopped = self.state == FAULTY and 0 <= now - self.receiver.stopped_at < _CROWDED_S
        restless = bool(self.answer.unrest) and self.state != IDLE
        if self.guard.dry or not (crowded or restless or stopped) or not self._due("SafeStop", STOP_PERIOD_S, now):
            return
        alone = self.frame_map.target, BY_OPERATOR if stopped else GUARD_REASON
        target, reason = (0, OTHER_CONTROLLER) if crowded else alone
        self.guard.send("SafeStop", {"Target": target, "Reason": reason}, now)

    def _steer(self, now: float, estimate: Estimate) -> None:
        """Update the reference from probe, experiment or operator; stop the drive once nobody has been in charge."""
        if self._probe is not None:
            self._end_probe(now, estimate)
        elif self.operator is None:
            self._interrupt(now + self.tick_s)
        if self.operator is None:
            return
        self.operator.expire(now)
        if self._led and self.operator.resting(now):
            self._led, self._rested = False, True
        if self._led and self._probe is None:
            self._reference = self.operator.follow(now, self._reference, self._position(estimate))

    def _interrupt(self, begin_s: float) -> None:
        """Begin the next experiment at `begin_s` if the reference rests there."""
        origin = self.estimator.origin_s
        if not (self._experiments and self._led and begin_s >= origin + self._experiments[0].at_s):
            return
        around = begin_s + np.array([-_REST_S, 0.0, _REST_S])
        if np.max(np.abs(self._reference.speed(around))) > _RESTS_M_S:
            return
        path = self._experiments.popleft().path
        centre = float(self._reference.position(around)[1])
        if np.max(np.abs(centre + path.positions)) <= self.task.limits.travel_m:
            self._reference = Excursion(self._reference, path, begin_s)
            self.experiments_at.append(begin_s - origin)

    def _begin_probe(self, begin_s: float, position_m: float) -> None:
        """Begin the probe at `position_m`, before the reference, if it is requested and not done yet."""
        if self._probed:
            return
        self._probe = Probe(self.envelope)
        self._probe_ends = begin_s + self._probe.path.end_s + self.envelope.limits.age_s
        self._reference = Shifted(self._probe.path, begin_s, position_m)
        self.estimator.begin(math.inf)

    def _end_probe(self, now: float, estimate: Estimate) -> None:
        """Once the probe's path is driven and its readings have arrived, begin the reference, or stop."""
        assert self._probe is not None
        if not self._led:
            self._probe = None
        elif now >= self._probe_ends:
            reason, self._probe, self._probed = self._probe.reason(), None, True
            if reason:
                self._fail(reason)
            self._begin_reference(now + self.tick_s, self.wanted_m(now))

    def _judge(self, now: float, arrived: list[Measurement], evidence: Evidence) -> None:
        if not self.guard.dry and (self.receiver.foreign or math.isfinite(self.receiver.stopped_at)):
            self._fail(self.receiver.other_controller or SAFE_STOP)
        self.answer.rests(self.receiver.state, self.receiver.still)
        if self.answer.unrest:
            self._fail(self.answer.unrest)
        if not self.leads:
            return
        ahead_s = -evidence.feedback_s
        reason = paused(ahead_s) if ahead_s > self.tick_s else self.receiver.doubt(now)
        if self._led:
            wanted_m = self.wanted_m(now)
            self._plausibility.wanted(wanted_m)
            reason = reason or self._plausibility.reason(self.estimator.counts.restarts)
            drive = self.receiver.report if not self.envelope.shaken else self.guard.sent.value
            late_s = self.estimator.model.delay_s
            found = self.answer.look(now, drive, wanted_m, arrived, late_s, self._reference, self._probe)
            reason = reason or found
            if self.receiver.state not in (wire.WAITING, *wire.MOVING):
                reason = reason or "drive left operation"
            reason = reason or self._own.halted
        if reason:
            self._fail(reason)

    def _fail(self, reason: str) -> None:
        if self.state == RUNNING:
            self.state, self.reason = FAULTY, reason
            ends = {CONTRADICT: "sensor_or_drive", "the drive does not rest": "no_rest", SAFE_STOP: "safe_stop"}
            self.end = ends.get(reason.partition(":")[0], "stopped")

    def _mode(self, evidence: Evidence, estimate: Estimate) -> int:
        """The mode of the next command: one state of the drive up at a time while running, else off."""
        if self.state != RUNNING or self._acknowledge:
            return wire.OFF
        if self._led:
            return wire.ENABLE
        if self.operator is not None and self.operator.let_go:
            return wire.OFF
        if (
            not self.receiver.beating
            or evidence.feedback_s > self.guard.fence.feedback_s
            or evidence.state in (wire.BOOT, wire.SELF_TEST)
        ):
            return wire.OFF
        if evidence.state == wire.STANDBY:
            return wire.READY
        if evidence.state == wire.WAITING:
            return wire.READY if estimate.lost else wire.ENABLE
        return wire.OFF

    def _act(self, now: float, mode: int, estimate: Estimate) -> Action:
        """The supervised controller's command once the drive is being enabled, else the drive's own position."""
        if mode != wire.ENABLE:
            return Action(self.receiver.report, "stopped")
        if not self._led:
            self._led = True
            if self.operator is not None and self.operator.taken:
                self._enabled_s = now
                self._reference = self.operator.enabled(self._position(estimate))
                self.estimator.begin(now + self.tick_s)
            elif self._here:
                self._enabled_s = now
                self._begin_reference(now + self.tick_s, self._position(estimate))
                self._begin_probe(now + self.tick_s, self._position(estimate))
            self.answer.begin()
            self._plausibility.settle(self.estimator.counts.restarts)
            self.supervisor.reset(now, estimate, self.receiver.report)
        self.supervisor.temperature_C = self.receiver.temperature_C
        self._own.room = self.answer.contradiction.breakaway.room
        action = self.supervisor.act(now + self.tick_s, estimate, self._reference)
        self.answer.contradiction.breakaway.sent(now + self.tick_s, action.command, self.tick_s)
        return action
