"""The periodic drive that moves the capsule at a mean speed for the least energy: multiple shooting over one cycle,
solved by IPOPT.

Over levels c_0..c_{N-1} in [0, 1], the period T and the nodes z_k = (x, v, r, r', u) and the lagging states of effects:

    minimise    sum c_k^2 F^2 R/k^2 T/N + sum c_k F (r_{k+1} - r_k)      over the distance  |v| T
    subject to  z_{k+1} = advance(z_k, c_k),  z_N = z_0 except  x_N - x_0 = v T,
                |T(u)| <= f_c while the wall sticks, s u >= 0 while it slips (softly),

with the smooth model. The exact model under the last solution gives where the wall sticks and slips, refreshed in each
round: a switching model has no derivatives there, a known sequence of modes has. The target speed of the next round is
corrected by the exact model's speed in the last one. Only results of the exact model are reported.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from controller.signals import Array
from controller.vibro.cycles import COPPER_N2_PER_W, Cycles, Gait, VibroModel
from controller.vibro.waveform import Waveform
from models.assembly.effects import Active
from models.assembly.step import Grip, Stepper
from models.drives.vibro import Vibro
from models.effects.effect import Signals
from models.parameter import Name
from models.surfaces.gut import Drag
from models.theta import Theta

NODES: tuple[Name, ...] = ("x", "v", (Vibro.name, "stretch_m"), (Vibro.name, "rate_m_s"), "u")
SCALE = np.array([1e-3, 0.1, 1e-3, 0.1, 1e-4])  # contents of every node (m, m/s, m, m/s, m) and the size of 1 in it


@dataclass(frozen=True)
class KnownSlip(Stepper):
    """A step whose wall keeps a given slip: `u' = v` in stick, `-s v_i` in slip, nothing switches."""

    def drag(self, s: Signals, drag: Drag, v: Any, h: Any, grip: Grip) -> Drag:
        if not self.surface.dragged:
            return drag
        return Drag(drag.u + h * ((1 - drag.slip * drag.slip) * v - drag.slip * grip.recovery), drag.slip)


@dataclass(frozen=True)
class CyclePart:
    """`advance(z, c, h, slip) -> z` over `STEPS` steps of h in s from the scaled node z (n,), the level c held;
    `strain(z)` = T(u)/f_c of the wall, None on a plate. A node has the states `names` in units of `scale`.
    """

    names: tuple[Name, ...]
    scale: Array
    advance: ca.Function
    strain: ca.Function | None


def smooth_part(model: VibroModel, smoothing: float, lags: Mapping[Name, float]) -> CyclePart:
    """A part of the cycle of `model` with friction smoothed over `smoothing` in m/s. Nodes have `NODES` and the
    effects' states in `lags`, each with its size; other states of effects stay at their start.
    """
    assembly = model.assembly(smoothing)
    vector = assembly.vector(model.values)
    p = Theta.of((parameter.key, float(v)) for parameter, v in zip(assembly.parameters, vector, strict=True))
    names, scale = (*NODES, *lags), np.concatenate((SCALE, list(lags.values())))
    z, c, h, slip = ca.SX.sym("z", len(names)), ca.SX.sym("c"), ca.SX.sym("h"), ca.SX.sym("slip")
    now: dict[Name, Any] = {name: ca.SX(assembly.initial[name]) for name in assembly.states}
    now |= {name: z[i] * scale[i] for i, name in enumerate(names)} | {"slip": slip}

    def stepper() -> KnownSlip:
        return KnownSlip(model.surface, model.drive, Active.of(model.effects, p, now), None, smoothing)

    for _ in range(STEPS):
        now, _output = stepper().advance(now, c, c, 0.0, h)
    end = ca.vertcat(*(now[name] / scale[i] for i, name in enumerate(names)))
    advance = ca.Function("advance", [z, c, h, slip], [end])
    if not model.surface.dragged:
        return CyclePart(names, scale, advance, None)
    u, v = z[4] * SCALE[4], z[1] * SCALE[1]
    _, onset = model.surface.hold(np.sqrt(v * v + smoothing**2), p.base, model.drive.carried_kg)
    own = stepper()
    strain = ca.Function("strain", [z], [own.tension(u) * own.stiffening(Signals(), u) / onset])
    return CyclePart(names, scale, advance, strain)


PARTS, STEPS = 32, 6  # of a cycle, and integration steps of each
SHORTEST_S, LONGEST_S = 0.008, 0.25  # least and most period
_SMOOTHING = (3e-3, 1e-3)  # m/s over which stick passes into slip, by round
_TIME = 0.01  # s, size of 1 of the scaled period
_STRETCH = 1.3  # factor by which a round may change the period
_ROUGH, _SLACK_SQUARE, _SLACK = 1e-3, 1.0, 0.3  # weights of steps between levels, and of slack squared and plain
_SETTLED = 0.02  # least saving of energy for another round
_REPEATS = 0.02  # share of its swing within which a periodic state returns
_CAUGHT = 6e-5  # m, wall displacement below which a slip ended by recovery of the wall, not by reversal
_OPTIONS: dict[str, Any] = {  # of ipopt
    "print_time": False,
    "show_eval_warnings": False,
    "ipopt": {
        "print_level": 0,
        "sb": "yes",
        "max_iter": 120,
        "tol": 1e-4,
        "acceptable_tol": 1e-2,
        "acceptable_iter": 5,
        "mu_init": 1e-2,
    },
}


def optimal_cycle(
    cycles: Cycles, speed_m_s: float, guess: Waveform, rounds: int = 5, close: float = 0.15
) -> tuple[Waveform, Gait] | None:
    """The least-energy cycle at the mean `speed_m_s`, not 0, from `guess`, with its gait on the exact model, whose
    speed may be off by the share `close`; None if no cycle is so near.

    Local: it keeps the order of events of `guess`. Raises ValueError for a speed of 0.
    """
    if speed_m_s == 0 or not np.isfinite(speed_m_s):
        raise ValueError(f"speed_m_s must be a finite speed that is not 0; got {speed_m_s:g}")
    lags = _lags(cycles, guess)
    programs = [smooth_part(cycles.model, eps, lags) for eps in _SMOOTHING]
    best: tuple[Waveform, Gait] | None = None
    waveform, aim = guess, speed_m_s * cycles.model.mirror
    for k in range(rounds):
        solution = _solve(cycles, programs[min(k, len(programs) - 1)], waveform, aim)
        if solution is None:
            break
        waveform = solution
        gait = cycles.gait(waveform)
        if abs(gait.speed_m_s - speed_m_s) <= close * abs(speed_m_s):
            settled = best is not None and gait.energy_J_per_m > (1 - _SETTLED) * best[1].energy_J_per_m
            if best is None or gait.energy_J_per_m < best[1].energy_J_per_m:
                best = (waveform, gait)
            if settled:
                break
        ratio = gait.speed_m_s / speed_m_s
        aim *= float(np.clip(1 / ratio, 0.75, 1.35)) if ratio > 0 else 1.35
    return best


def _lags(cycles: Cycles, waveform: Waveform) -> dict[Name, float]:
    """The effects' states that swing with the cycle, each with the size of its swing."""
    states = cycles.last_cycle(waveform, PARTS)
    ids = {effect.id for effect in cycles.model.effects}
    found: dict[Name, float] = {}
    for column, name in enumerate(cycles.states):
        path = states[:, column]
        swing = float(np.ptp(path))
        if not isinstance(name, str) and name[0] in ids and swing > 0 and abs(path[-1] - path[0]) < _REPEATS * swing:
            found[name] = swing
    return found


def _solve(cycles: Cycles, part: CyclePart, waveform: Waveform, aim: float) -> Waveform | None:
    """One round from `waveform`, or None if IPOPT gave nothing finite."""
    states = cycles.last_cycle(waveform, 2 * PARTS)
    columns = [cycles.states.index(name) for name in part.names]
    start = states[::2, columns] / part.scale
    start[:, 0] -= start[0, 0]
    slip = np.round(states[1::2, cycles.states.index("slip")])
    program = _Program(cycles.model, part, aim)
    solver, low, high = program.solver(slip, start)
    nodes = len(part.names) * (PARTS + 1)
    period = waveform.period_s
    x0 = np.concatenate((start.ravel(), waveform.sampled(PARTS), [period / _TIME], np.zeros(PARTS + 1)))
    shortest, longest = max(SHORTEST_S, period / _STRETCH) / _TIME, min(LONGEST_S, period * _STRETCH) / _TIME
    free, none, ones = np.full(nodes, np.inf), np.zeros(PARTS), np.ones(PARTS)
    lower = np.concatenate((-free, none, [shortest], np.zeros(PARTS + 1)))
    upper = np.concatenate((free, ones, [longest], np.full(PARTS + 1, 5.0)))
    answer = np.array(solver(x0=x0, lbx=lower, ubx=upper, lbg=low, ubg=high)["x"]).ravel()
    if not np.isfinite(answer).all():
        return None
    return Waveform.even(float(answer[nodes + PARTS]) * _TIME, answer[nodes : nodes + PARTS])


class _Program:
    """The nonlinear program of one round in CasADi symbols: nodes Z (n, N + 1), levels C, period T, slacks E."""

    def __init__(self, model: VibroModel, part: CyclePart, aim: float) -> None:
        self.model, self.part, self.aim = model, part, aim
        self.Z, self.C = ca.MX.sym("Z", len(part.names), PARTS + 1), ca.MX.sym("C", PARTS)
        self.T, self.E = ca.MX.sym("T"), ca.MX.sym("E", PARTS + 1)

    def cost(self) -> Any:
        """Energy per distance in units of 10 J/m, with a small cost of rough levels and the cost of slacks."""
        force, time = self.model.force_N, self.T * _TIME
        copper = ca.sumsqr(self.C) * time / PARTS * force * force / COPPER_N2_PER_W
        moved = self.Z[2, 1:] - self.Z[2, :-1]
        if not self.model.drive.reaction_on_body:
            moved = moved + self.Z[0, 1:] - self.Z[0, :-1]
        work = ca.dot(self.C, moved.T) * force * SCALE[2]
        rough = ca.sumsqr(self.C[1:] - self.C[:-1])
        slack = _SLACK_SQUARE * ca.sumsqr(self.E) + _SLACK * ca.sum1(self.E)
        return (copper + work) / (10 * abs(self.aim) * time) + _ROUGH * rough + slack

    def solver(self, slip: Array, start: Array) -> tuple[ca.Function, Array, Array]:
        h = self.T * (_TIME / (PARTS * STEPS))
        ends = self.part.advance.map(PARTS)(self.Z[:, :-1], self.C.T, h, ca.DM(slip).T)
        distance = self.aim * self.T * _TIME / SCALE[0]
        rows = [ca.vec(ends - self.Z[:, 1:]), self.Z[1:, -1] - self.Z[1:, 0], self.Z[0, 0], self.Z[0, -1] - distance]
        equal = np.zeros(len(self.part.names) * (PARTS + 1) + 1)
        more, low, high = self._wall(slip, start)
        unknown = ca.vertcat(ca.vec(self.Z), self.C, self.T, self.E)
        program = {"x": unknown, "f": self.cost(), "g": ca.vertcat(*rows, *more)}
        return ca.nlpsol("cycle", "ipopt", program, _OPTIONS), np.append(equal, low), np.append(equal, high)

    def _wall(self, slip: Array, start: Array) -> tuple[list[Any], Array, Array]:
        """The constraints that keep the wall's modes true: rows with lower and upper bounds."""
        if self.part.strain is None:
            return [], np.zeros(0), np.zeros(0)
        strain = self.part.strain.map(PARTS + 1)(self.Z)
        rows: list[tuple[Any, float, float]] = []
        for k in range(PARTS):
            s, after, slack = slip[k], slip[(k + 1) % PARTS], self.E[k + 1]
            if s == 0:
                rows += [(strain[k + 1] - slack, -np.inf, 1.0), (strain[k + 1] + slack, -1.0, np.inf)]
                if after != 0:
                    rows.append((after * strain[k + 1] + slack, 0.9, np.inf))
            else:
                rows.append((s * self.Z[4, k + 1] + slack, -0.05, np.inf))
                if after == 0 and abs(start[k + 1, 4]) * SCALE[4] < _CAUGHT:
                    rows.append((s * self.Z[4, k + 1] - slack, -np.inf, 0.3))
        return [row[0] for row in rows], np.array([row[1] for row in rows]), np.array([row[2] for row in rows])
