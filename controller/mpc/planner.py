"""From a state and a guess to a better plan: a few Gauss-Newton SQP steps with a line search."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from controller.limits import Envelope
from controller.model.control_model import ControlModel
from controller.mpc.program import FREE, Program, cost, keep_feasible, quadratic, sensitivities
from controller.signals import Array
from controller.tuned import Horizon, Weights

_SHORTENINGS = (1.0, 0.4, 0.1)  # shares of a step that the line search tries
_PRESSED = 0.5  # share of the bound on the wall's force above which every trial computes it
_ENOUGH = 5e-3  # least gain of a step, as a share of the cost, for another step
_LITTLE = 1e-6  # negligible cost
CATCH_S = 0.03  # time constant with which a guess approaches the reference


@dataclass
class MpcPlan:
    """Commands (N + 1,) and their predicted path (N + 1, n), with the cost. `iterations` done, whether the deadline
    `cut` them, whether the last one gained little (`settled`), `failed` if nothing finite resulted, and the seconds of
    each phase.
    """

    commands: Array
    path: Array
    cost: float = np.inf
    iterations: int = 0
    cut: bool = False
    settled: bool = False
    failed: bool = False
    timings: dict[str, float] = field(default_factory=dict)


class Start(NamedTuple):
    """Start of a plan: time in s, state (n,), disturbance, and the parameters (p,) if not the model's own."""

    now: float
    state: Array
    disturbance_N: float = 0.0
    parameters: Array | None = None


class PlanNumbers(NamedTuple):
    """`scales` (5,): position, speed, rate, jump, final; `soft` and `penalty` (3,): bounds of gap, speed and wall force
    and their weights; `hard` (4,): low, high, rate, acceleration. `follows` is 1 if a command that moves with the
    reference costs nothing (a carriage), else 0.
    """

    scales: Array
    soft: Array
    penalty: Array
    hard: Array
    follows: float


def plan_numbers(model: ControlModel, envelope: Envelope, weights: Weights, horizon: Horizon) -> PlanNumbers:
    """A plan's weights and bounds in the command's unit: the force per command converts the weights' N/s."""
    gain = model.force_per_command
    scales = (weights.position_m, weights.speed_m_s, weights.rate_N_s / gain, weights.jump_N_s / gain, weights.final)
    most = min(envelope.rate, (envelope.high - envelope.low) / horizon.stage_s)
    return PlanNumbers(
        np.array(scales),
        np.minimum([envelope.gap_m, envelope.limits.speed_m_s, envelope.limits.force_N], FREE),
        np.array([weights.gap, weights.speed, weights.force]),
        np.array([envelope.low, envelope.high, most, min(envelope.acceleration, FREE)]),
        1.0 if model.drive.gap_limit_m is not None else 0.0,
    )


class Planner:
    """Plans over a horizon of one model; arrays are allocated here, once."""

    def __init__(
        self,
        model: ControlModel,
        envelope: Envelope,
        weights: Weights,
        horizon: Horizon,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.model, self.horizon, self.clock = model, horizon, clock
        n, N = len(model.states), horizon.stages
        self.scales, self.soft, self.penalty, self.hard, self.follows = plan_numbers(model, envelope, weights, horizon)
        unit = float(self.scales[2])
        self.program = Program(N, horizon.stage_s, model.tick_s, unit, self.hard, self.soft, self.penalty)
        self.A, self.B, self.Z = np.zeros((N, n, n)), np.zeros((N, n, 2)), np.zeros((N + 1, n, N))
        self.forces, self.slopes = np.zeros(N + 1), np.zeros((N + 1, n))
        self.allowed: int | None = None

    def plan(self, start: Start, reference: Array, guess: Array, last_rate: float) -> MpcPlan:
        """The plan from `start`. `guess` (N + 1,) begins with the command in force, which changes at `last_rate`;
        `reference` (3, N + 1): position, speed, command rate. Never raises; bounded by `horizon.iterations`.
        """
        begin = self.clock()
        warm, ahead = self.candidates(start, reference, guess, last_rate)
        best = ahead if ahead.cost < warm.cost or not math.isfinite(warm.cost) else warm
        best.timings = dict.fromkeys(("candidates", "linearise", "condense", "solve", "search"), 0.0)
        moment = self.clock()
        best.timings["candidates"], longest = moment - begin, 0.0
        best.failed = not math.isfinite(best.cost)
        while not best.failed and best.iterations < self.horizon.iterations:
            late = moment - begin + longest > self.horizon.deadline_s
            if late if self.allowed is None else best.iterations >= self.allowed:
                best.cut = True
                break
            last = moment
            better = self._iterate(best)
            moment = self.clock()
            longest = max(longest, moment - last)
            if not better:
                best.settled = True
                break
        best.timings["total"], self.allowed = moment - begin, None
        return best

    def candidates(self, start: Start, reference: Array, guess: Array, last_rate: float) -> tuple[MpcPlan, MpcPlan]:
        """The guess, and the plan that follows the reference by inverting the model, both within the hard bounds."""
        k, h, b = self.model.kernels, self.horizon, self.hard
        parameters = k.parameters if start.parameters is None else start.parameters
        self._task = (reference, last_rate, h.stage_s)
        self._motion = (start.disturbance_N, start.now, h.stage_s, h.substeps, parameters)
        self._pressed = self.soft[2] < FREE
        warm, ahead = (MpcPlan(np.array(guess), np.zeros((h.stages + 1, start.state.size))) for _ in range(2))
        warm.path[0] = ahead.path[0] = start.state
        bounds = (CATCH_S, b[2], b[0], b[1])
        k.pursue(ahead.path, ahead.commands, reference, bounds, self._motion)
        self._roll(warm)
        self._roll(ahead)
        return warm, ahead

    def _roll(self, plan: MpcPlan) -> None:
        """Move a plan's commands within the hard bounds, compute path and cost."""
        keep_feasible(plan.commands, self._task[1], self.horizon.stage_s, self.model.tick_s, self.hard)
        self.model.kernels.roll(plan.path, plan.commands, self._motion)
        self._price(plan)

    def _price(self, plan: MpcPlan) -> None:
        if self._pressed:
            _, now, stage_s, _, parameters = self._motion
            self.model.kernels.holds(plan.path, self.forces, self.slopes, now, stage_s, parameters)
        numbers = (self.scales, self.soft, self.penalty)
        plan.cost = float(cost(plan.path, plan.commands, self.forces, self._task, *numbers))

    def _iterate(self, best: MpcPlan) -> bool:
        """One SQP step from `best`, which it changes; False if another would gain too little."""
        program, stage_s, took, t0 = self.program, self.horizon.stage_s, best.timings, self.clock()
        self.model.kernels.linearise(best.path, self.A, self.B, best.commands, self._motion)
        self._pressed = self.soft[2] < FREE
        self._price(best)
        self._pressed = self._pressed and float(np.abs(self.forces).max()) > _PRESSED * self.soft[2]
        t1 = self.clock()
        sensitivities(self.A, self.B, program.unit * stage_s, self.Z)
        quadratic(best.path, best.commands, self.Z, self._task, self.scales, program.unit, program.H, program.f)
        t2 = self.clock()
        change = program.solve(best.path, best.commands, self.forces, self.slopes, self.Z, self._task[1])
        t3 = self.clock()
        took["linearise"] += t1 - t0
        took["condense"] += t2 - t1
        took["solve"] += t3 - t2
        best.iterations += 1
        if change is None:
            best.failed = best.iterations == 1
            return False
        gain = self._search(best, change)
        took["search"] += self.clock() - t3
        return gain > _ENOUGH * (abs(best.cost) + _LITTLE)

    def _search(self, best: MpcPlan, change: Array) -> float:
        """Follow `change` as far as the cost falls; returns the gain."""
        moves = np.concatenate([[0.0], np.cumsum(change)]) * (self.program.unit * self.horizon.stage_s)
        trial = MpcPlan(best.commands, best.path.copy())
        for share in _SHORTENINGS:
            trial.commands = best.commands + share * moves
            self._roll(trial)
            if trial.cost < best.cost:
                gain = best.cost - trial.cost
                best.commands, best.path, best.cost = trial.commands, trial.path, trial.cost
                return gain
        return 0.0
