"""The controller of an inner mass: a waveform for the mean speed, changed at the end of a cycle, in a slow loop."""

import math
import time

import numpy as np
from numpy.typing import NDArray

from controller.drives import INNER_MASS
from controller.model.control_model import ControlModel
from controller.signals import Action, Controller, Estimate, Reference, Status
from controller.vibro.cycles import VibroModel
from controller.vibro.drive_map import designed
from controller.vibro.gears import Choice, DriveMap
from controller.vibro.slow_loop import AveragedMpc, ProgressFilter, Tuning
from controller.vibro.waveform import REST, Waveform

_FAR = 1e3  # m or m/s, beyond which a number is invalid
_REGEAR = 0.2  # least change of the wanted speed, as a share, for a new choice of gear


class VibroController(Controller):
    """`act` gives the level (0 to 1 of the coil's force) of the tick from the phase of the present cycle. At the end of
    a cycle the filter's state of the averaged motion gives a plan of mean speeds by the MPC; the map turns the first
    one into the next waveform. Each gear or direction keeps the bias learned in it. The status is `limited` while the
    reach of the map bounds the command.
    """

    name = INNER_MASS.leading

    def __init__(self, drive: DriveMap, tuning: Tuning | None = None) -> None:
        self.drive, self.tuning = drive, tuning or Tuning()
        self.filter = ProgressFilter(drive.lag_s)
        self.mpc = AveragedMpc(drive.lag_s)
        self._biases: dict[int, float] = {}
        self._begin(0.0, 0.0)

    def _begin(self, now: float, position: float) -> None:
        self.filter.start(now, position)
        self._cycle = Choice(REST, None, 0.0, True)
        self._cycle_start, self._seen, self._stamp, self._planned = now - REST.period_s, now, -math.inf, 0.0
        self._geared_for = 0.0
        self._behind: bool | None = None
        self._status: Status = "ok"
        self._solve_s = 0.0

    def reset(self, now: float, estimate: Estimate, command: float) -> None:
        """Begin at `now` in s at rest at the estimate, with the biases learned before."""
        position = self._position(estimate)
        self._begin(now, 0.0 if position is None else position)

    @property
    def waveform(self) -> Waveform:
        return self._cycle.waveform

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Action:
        started = time.perf_counter()
        self._look(now, estimate)
        level = self._level(now, reference)
        timings = {"total": time.perf_counter() - started, "plan": self._solve_s}
        self._solve_s = 0.0
        return Action(level, self._status, None, timings)

    def _position(self, estimate: Estimate) -> float | None:
        if estimate.lost or not estimate.state.size:
            return None
        value = float(estimate.state[0])
        return value if abs(value) < _FAR else None

    def _look(self, now: float, estimate: Estimate) -> None:
        position = self._position(estimate)
        if position is None or not self._stamp + self.tuning.sample_s <= estimate.time_s <= now + self.tuning.tick_s:
            return
        self._stamp, self._seen = estimate.time_s, now
        self.filter.predict(min(estimate.time_s, now), self._cycle.speed_m_s)
        self.filter.correct(position)

    def _level(self, now: float, reference: Reference) -> float:
        """Mean level over the tick, across the end of a cycle."""
        tick, total, at = self.tuning.tick_s, 0.0, now
        end = now + tick
        for _ in range(4):
            period = self._cycle.waveform.period_s
            stop = self._cycle_start + period
            if at >= stop - 1e-9:
                self._cycle_start = stop if at - stop < tick else at
                self._next(now, reference)
                continue
            until = min(end, stop)
            a, b = (at - self._cycle_start) / period, (until - self._cycle_start) / period
            total += self._cycle.waveform.mean(max(a, 0.0), min(b, 1.0)) * (until - at)
            at = until
            if at >= end - 1e-12:
                break
        return min(max(total / tick, 0.0), 1.0)

    def _next(self, now: float, reference: Reference) -> None:
        started = time.perf_counter()
        ahead = np.asarray(now + self.mpc.step_s * np.arange(self.mpc.horizon + 1), dtype=np.float64)
        positions, speeds = reference.position(ahead), reference.speed(ahead)
        if not ((abs(positions) < _FAR).all() and (abs(speeds) < _FAR).all()):
            self._take(Choice(REST, None, 0.0, True), "failed")
        elif now - self._seen > self.tuning.blind_s and self.tuning.feedback:
            self._take(Choice(REST, None, 0.0, True), "lost")
        else:
            self._planned = self._plan(now, positions, speeds)
            wanted, gear = float(speeds[0]), self._cycle.gear
            if abs(wanted - self._geared_for) > _REGEAR * abs(self._geared_for):
                self._geared_for, gear = wanted, self.drive.nearest(wanted)
            choice = self.drive.choose(self._planned, gear)
            low, high = self.drive.reach()
            self._take(choice, "ok" if choice.reachable and low < self._planned < high else "limited")
        self._solve_s = time.perf_counter() - started

    def _plan(self, now: float, positions: NDArray[np.float64], speeds: NDArray[np.float64]) -> float:
        wanted = float(speeds[0])
        if not self.tuning.feedback:
            return wanted
        t, f = self.tuning, self.filter
        f.predict(now, self._cycle.speed_m_s)
        missing = float(positions[0]) - float(f.z[0])
        if abs(wanted) < 1e-6 and abs(missing) < t.near_m:
            return 0.0
        self._behind = abs(missing) > t.near_m and self._behind is not False
        share = t.catch_up_stopped if self._behind else t.catch_up
        most = t.catch_up_s * max(share * abs(wanted), 0.5e-3 if abs(wanted) < 1e-6 else 0.0)
        shift = missing - min(max(missing, -most), most)
        low, high = self.drive.reach()
        low, high = (0.0, high) if wanted > 0 else (low, 0.0) if wanted < 0 else (low, high)
        return float(self.mpc.plan(f.z, self._planned, positions[1:] - shift, speeds[1:], low, high)[0])

    def _take(self, choice: Choice, status: Status) -> None:
        before, after = self._cycle.gear, choice.gear
        if before != after:
            if before is not None:
                self._biases[before] = float(self.filter.z[2])
            known = 0.0 if after is None else self._biases.get(after, 0.0)
            self.filter.doubt_bias(known, choice.speed_m_s)
        self._cycle, self._status = choice, status


def vibro_controller(model: ControlModel, optimise: bool = True, feedback: bool = True) -> VibroController:
    """The controller of `model`'s inner mass, its drive map designed on that model and cached on disk; `optimise` False
    uses square waves, `feedback` False the map alone. Raises ValueError for a rig without an inner mass on a spring.
    """
    drive = designed(VibroModel.from_rig(model.rig, model.theta), optimise)
    return VibroController(drive, Tuning(tick_s=model.tick_s, feedback=feedback))
