"""The MPC beside do-mpc and beside the converged solution, same problem, same run: `python -m tests.bench.bench_mpc
[SECONDS]`.

Wall-clock ms suffer from whatever else the machine does, ms of the thread's own time do not: both are printed, and
ratios of one run. Needs the extra `bench` (do-mpc).
"""

import gc
import math
import os
import sys
from dataclasses import fields, replace
from unittest.mock import patch

import numpy as np

from controller.model.control_model import ControlModel
from controller.mpc.mpc import MPC
from controller.step.compiled import CompiledChain, compiled
from controller.step.library import available
from controller.step.numbers import numbers_of
from controller.tuned import FilterNoise
from tests.bench.mpc_peers import converged, do_mpc
from tests.bench.mpc_problem import (
    BOUNDS,
    HORIZON,
    TICK_S,
    WEIGHTS,
    Act,
    Array,
    Outcome,
    Strides,
    estimate,
    loop,
    problem_model,
)

MISMATCHES = (1.0, 1.15, 0.85)
GRIP = "friction_coefficient"  # what the C code calls the parameter of the wall's slip


def product(iterations: int) -> Act:
    """The MPC of this project, at most `iterations` SQP steps a tick."""
    mpc = MPC(problem_model(), BOUNDS, WEIGHTS, replace(HORIZON, iterations=iterations, rest_m=1e-9))
    mpc.reset(0.0, estimate(0.0, np.zeros(4), 0.0), 0.0)
    reference = Strides()

    def act(now: float, state: Array, force: float, command: float, rate: float) -> float:
        action = mpc.act(now, estimate(now, state, force), reference)
        return action.command if action.status in ("ok", "late") else np.nan

    return act


class Sharp(ControlModel):
    """The problem's model, its own with nearly exact friction: no estimator is before it."""

    @property
    def sharp(self) -> ControlModel:
        return self


def in_c(iterations: int) -> Act:
    """The same MPC in C, with its fallbacks and limits, as one call a tick."""
    problem = problem_model()
    named = [replace(p, name=GRIP if p.name == "slip_m" else p.name) for p in problem.symbols.parameters]
    problem = replace(problem, symbols=replace(problem.symbols, parameters=tuple(named)))
    model = Sharp(**{f.name: getattr(problem, f.name) for f in fields(problem)})
    same = {"Weights": lambda: WEIGHTS, "noise_of": lambda *_: FilterNoise()}
    with patch.multiple("controller.step.numbers", **same):
        numbers = numbers_of("mpc", model, BOUNDS, horizon=replace(HORIZON, iterations=iterations, rest_m=1e-9))
    found = compiled("mpc", model, BOUNDS, numbers)
    assert found is not None
    chain, reference = CompiledChain(found), Strides()
    chain.given.least, chain.given.most, chain.given.temperature_C = -math.inf, math.inf, 20.0
    chain.start(0.0, estimate(0.0, np.zeros(4), 0.0), 0.0)

    def act(now: float, state: Array, force: float, command: float, rate: float) -> float:
        chain.given.time_s = now
        chain.believe(estimate(now, state, force))
        chain.refer(now, reference)
        chain.run()
        return chain.out.command if chain.out.active == 0 else np.nan

    return act


def row(name: str, o: Outcome, base: Outcome, peer: Outcome) -> str:
    """One line of the table: times of both clocks, cost against the converged one, speed against the peer."""
    clocks = "  ".join(f"{np.median(a):7.3f} {np.percentile(a, 99):7.3f} {a.max():7.2f}" for a in (o.wall_ms, o.own_ms))
    faster = np.median(peer.wall_ms) / np.median(o.wall_ms)
    return (
        f"{name:24s} {clocks}  {o.cost:8.3f} {o.cost / base.cost:6.3f} {1e3 * o.rmse_m:8.4f} {faster:7.1f}"
        f" {o.failed:4d}"
    )


def main(seconds: float) -> None:
    """Print a table for each mismatch of the plant."""
    makers = {"IPOPT, converged": converged, "do-mpc, collocation": do_mpc}
    makers |= {f"MPC, {n} SQP steps": lambda n=n: product(n) for n in (1, 2, 3, 30)}
    makers |= {f"MPC in C, {n} SQP steps": lambda n=n: in_c(n) for n in (1, 2, 3) if available()}
    for mismatch in MISMATCHES:
        print(
            f"load {os.getloadavg()[0]:.1f}; plant's friction and wall {mismatch:g} times the model's; noise;"
            f" {round(seconds / TICK_S)} ticks"
        )
        print(
            f"{'':24s} {'wall ms: median, p99, max':24s} {'own ms: median, p99, max':26s} {'cost':8s} {'/conv':6s} rmse"
            " mm  /do-mpc fail"
        )
        outcomes = {}
        for name, make in makers.items():
            act = make()
            gc.collect()
            gc.freeze()
            outcomes[name] = loop(act, seconds, 7, mismatch)
        for name, outcome in outcomes.items():
            print(row(name, outcome, outcomes["IPOPT, converged"], outcomes["do-mpc, collocation"]), flush=True)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 3.0)
