"""The model predictive controller: from estimate and reference to the next command."""

import math
import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from controller.drives import bodies, envelope_of
from controller.limits import Envelope, number
from controller.model.control_model import ControlModel
from controller.mpc.planner import MpcPlan, Planner, Start
from controller.signals import Action, Array, Controller, Estimate, Reference, Status
from controller.tuned import Horizon, Weights

REST_S = 0.05  # a capsule that takes longer to cross the band counts as resting
REST_STDS = 3.0  # standard deviations of the estimate that count as rest
_WIDEST = 3.0  # times the horizon's `rest_m`, for any estimate
_CALM = 0.99  # share of the greatest change of rate below which a plan is followed
_SAME = 1e-9  # share of the range within which two commands are equal


class MPC(Controller):
    """Tracks a reference by planning over a horizon with the control model, offset-free through the estimate's
    disturbance.

    `act` gives the command at the end of the tick, the predicted path (N + 1 positions) and the seconds of each phase.
    Status: "late" if the deadline left no time for a step (the plan still meets the hard bounds); "lost" with the
    estimate, "failed" if something was not finite or unsolvable: then the last command is kept.

    A plan that still gained in its last step continues in the next tick. Bounded by `horizon.iterations` and
    `horizon.deadline_s`. Raises only on construction, ValueError for an inner mass.
    """

    name = "mpc"

    def __init__(
        self,
        model: ControlModel,
        envelope: Envelope | None = None,
        weights: Weights | None = None,
        horizon: Horizon | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        if model.drive.name not in bodies():
            raise ValueError(f"model must be of a {' or '.join(bodies())} rig for the MPC; got {model.drive.name!r}")
        self.model, self.clock = model, clock
        self.horizon, self.envelope = horizon or Horizon(), envelope or envelope_of(model.drive)
        self.planner = Planner(model, self.envelope, weights or Weights(), self.horizon, clock)
        self._modes = [model.index(name) for name in model.modes]
        names = [p.key for p in model.symbols.parameters]
        self._grip = names.index("friction_coefficient") if "u" in model.states and self.horizon.late_slip > 0 else None
        self._grid: Array = np.linspace(0.0, self.horizon.stages * self.horizon.stage_s, self.horizon.stages + 1)
        self._begin(0.0, 0.0)
        self._same = _SAME * (self.envelope.high - self.envelope.low)
        self.last: MpcPlan | None = None
        self._compile()

    def _compile(self) -> None:
        """Make one plan, so that the machine code exists before the first tick."""
        self.allow(1)
        targets = np.zeros((3, self._grid.size))
        targets[0] = 1e-3
        self.planner.plan(Start(0.0, self.model.initial()), targets, np.zeros(self._grid.size), 0.0)

    def reset(self, now: float, estimate: Estimate, command: float) -> None:
        self._begin(now, float(command) if np.isfinite(command) else 0.0)

    def _begin(self, now: float, command: float) -> None:
        self._command, self._rate, self._time, self._resting, self._followable = command, 0.0, now, False, False
        self._plan = np.full(self.horizon.stages + 1, command)

    def follow(self, command: float, rate: float) -> None:
        """Plan from `command` and its `rate` if they differ from the plan."""
        if abs(command - self._command) > self._same:
            self._command, self._rate, self._followable = command, rate, False

    def allow(self, steps: int) -> None:
        """Cut the next plan after `steps`, independent of the clock."""
        self.planner.allowed = steps

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Action:
        begin = self.clock()
        if estimate.lost:
            return self._kept("lost", begin)
        state = np.array(estimate.state, dtype=float)
        command = self._foreseen(now, state)
        if command is not None:
            self._rate, self._command = (command - self._command) / self.model.tick_s, command
            return Action(command, "ok", None, {"total": self.clock() - begin})
        targets = self._targets(now, reference)
        sound = state.shape == (len(self.model.states),) and math.isfinite(state.sum() + now + estimate.disturbance_N)
        if targets is None or not sound:
            return self._kept("failed", begin)
        if self._rests(state, number(estimate.std[0]) if np.size(estimate.std) else 0.0, targets):
            self._halt()
            return Action(self._command, "ok", np.full(self._grid.size, state[0]), {"total": self.clock() - begin})
        for k in self._modes:
            state[k] = round(min(max(state[k], -1.0), 1.0))
        guess, (force, parameters) = self._shifted(now, targets), self._learned(estimate)
        plan = self.planner.plan(Start(now, state, force, parameters), targets, guess, self._rate)
        self.last = plan
        if plan.failed:
            return self._kept("failed", begin)
        self._followable = plan.settled and self._calm(plan.commands)
        self._rate = float(plan.commands[1] - plan.commands[0]) / self.horizon.stage_s
        self._plan, self._time = plan.commands, now
        self._command = _along(plan.commands, self.model.tick_s / self.horizon.stage_s)
        timings = plan.timings | {"total": self.clock() - begin}
        late, cut_after = plan.cut and not plan.iterations, plan.iterations if plan.cut else None
        return Action(self._command, "late" if late else "ok", plan.path[:, 0].copy(), timings, cut_after)

    def _foreseen(self, now: float, state: Array) -> float | None:
        """The last plan's command for this tick; None if a new plan is due (`Horizon`) or the state is not a number."""
        age, tick, h, plan = now - self._time, self.model.tick_s, self.horizon, self.last
        if plan is None or not self._followable or not 0 < age < h.hold_s - 0.5 * tick:
            return None
        near = abs(state[0] - _along(plan.path[:, 0], age / h.stage_s)) <= h.hold_m
        return _along(plan.commands, (age + tick) / h.stage_s) if near and math.isfinite(state.sum()) else None

    def _calm(self, commands: Array) -> bool:
        """Whether the rates of all stages in which a plan may be followed, and of the next one, differ by less than a
        tick's acceleration. A plan with faster changes is made again each tick.
        """
        stage, before = self.horizon.stage_s, self._rate
        ahead = commands[: math.ceil(self.horizon.hold_s / stage) + 2].tolist()
        for here, there in pairwise(ahead):
            rate = (there - here) / stage
            if not abs(rate - before) < _CALM * self.envelope.acceleration * self.model.tick_s:
                return False
            before = rate
        return True

    def _learned(self, estimate: Estimate) -> tuple[float, Array | None]:
        """The disturbance to plan with, and its parameters if they are not the model's."""
        force, parameters = estimate.disturbance_N, None
        learned = estimate.adapted
        if learned is not None:
            found = np.array(learned.parameters, dtype=float)
            if found.shape == self.model.values.shape and math.isfinite(found.sum() + learned.disturbance_N):
                force, parameters = learned.disturbance_N, found
        if self._grip is not None:
            parameters = self.model.values.copy() if parameters is None else parameters
            parameters[self._grip] *= 1 + self.horizon.late_slip
        return force, parameters

    def _targets(self, now: float, reference: Reference) -> Array | None:
        """Position, speed and command rate (3, N + 1) over the horizon; None if not numbers."""
        times: Array = now + self._grid
        try:
            targets = np.empty((3, times.size))
            targets[0], targets[1] = reference.position(times), reference.speed(times)
        except (ValueError, TypeError, ArithmeticError, LookupError, AttributeError):
            return None
        targets[2] = self.planner.follows * targets[1]
        return targets if np.isfinite(targets.sum()) else None

    def _shifted(self, now: float, targets: Array) -> Array:
        """The last plan from `now` on, continued at the reference's rate, from the command in force."""
        passed = now - self._time
        times = passed + self._grid
        commands = np.interp(times, self._grid, self._plan)
        commands += np.maximum(times - self._grid[-1], 0.0) * targets[2, -1]
        commands[0] = self._command
        return np.asarray(commands)

    def _rests(self, state: Array, std_m: float, targets: Array) -> bool:
        """Whether to leave the capsule alone: as near as the estimate, with standard deviation `std_m`, can tell."""
        band = max(self.horizon.rest_m, min(REST_STDS * std_m, _WIDEST * self.horizon.rest_m))
        near = abs(state[0] - targets[0, 0]) < (2 if self._resting else 1) * band
        slow = targets[1, 0] == 0 and abs(self._rate) * self.model.tick_s < self.horizon.rest_m
        still = near and slow and not targets[1].any() and bool((targets[0] == targets[0, 0]).all())
        self._resting = bool(still and (self._resting or abs(state[1]) < self.horizon.rest_m / REST_S))
        return self._resting

    def _halt(self) -> None:
        self._rate, self._followable = 0.0, False
        self._plan[:] = self._command

    def _kept(self, status: Status, begin: float) -> Action:
        self._halt()
        return Action(self._command, status, None, {"total": self.clock() - begin})


def _along(values: Array, stages: float) -> float:
    """`values` (N + 1,), one per stage, at `stages` after the first, linear between."""
    k = min(int(stages), values.shape[0] - 2)
    return float(values[k] + (stages - k) * (values[k + 1] - values[k]))
