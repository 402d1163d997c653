"""Peers of the MPC on the same problem: do-mpc (collocation, IPOPT) and the same discretised problem solved by IPOPT to
the end.
"""

import contextlib
import io
import warnings
from collections.abc import Iterator
from typing import Any

import casadi as ca
import numpy as np

from controller.mpc.planner import Planner, Start
from tests.bench.mpc_problem import (
    BOUNDS,
    HORIZON,
    PARAMETERS,
    TICK_S,
    WEIGHTS,
    Act,
    Array,
    Strides,
    advance,
    problem_model,
    slope,
)

QUIET = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": 0}


@contextlib.contextmanager
def as_peers_expect() -> Iterator[None]:
    """Without CasADi's NumPy functions, which do-mpc was not written for, and without its chatter."""
    ca.GlobalOptions.setNumpyMode(0)
    try:
        with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        ca.GlobalOptions.setNumpyMode(1)


def do_mpc(elements: int = 1) -> Act:
    """do-mpc: collocation (Radau, degree 2, `elements` a stage), IPOPT with mumps, warm from its last solution."""
    with as_peers_expect():
        import do_mpc as peer

    model = peer.model.Model("continuous", "SX")
    names = ("x", "v", "u", "f", "c")
    x = [model.set_variable("_x", name) for name in names]
    w = model.set_variable("_u", "w")
    d, r, s = (model.set_variable("_tvp", name) for name in ("d", "r", "s"))
    for name, rhs in zip(names, [*slope(ca.vertcat(*x[:4]), x[4], d, dict(PARAMETERS)), w], strict=True):
        model.set_rhs(name, ca.SX(rhs))
    model.setup()
    mpc = peer.controller.MPC(model)
    mpc.settings.n_horizon, mpc.settings.t_step, mpc.settings.store_full_solution = HORIZON.stages, TICK_S, False
    mpc.settings.nlpsol_opts, mpc.settings.collocation_ni = QUIET, elements
    gap, pace = 0.5 * ((x[0] - r) / WEIGHTS.position_m) ** 2, 0.5 * ((x[1] - s) / WEIGHTS.speed_m_s) ** 2
    mpc.set_objective(lterm=gap + pace + 0.5 * (w / WEIGHTS.rate_N_s) ** 2, mterm=WEIGHTS.final * gap + pace)
    mpc.set_rterm(w=0.5 / WEIGHTS.jump_N_s**2)
    for side, rate, command in (("lower", -BOUNDS.rate, BOUNDS.low), ("upper", BOUNDS.rate, BOUNDS.high)):
        mpc.bounds[side, "_u", "w"], mpc.bounds[side, "_x", "c"] = rate, command
    for name, scale in (("x", 1e-3), ("v", 1e-2), ("u", 1e-4), ("f", 0.1), ("c", 0.1)):
        mpc.scaling["_x", name] = scale
    table, told, reference = mpc.get_tvp_template(), {"d": 0.0}, Strides()

    def varying(now: float) -> Any:
        times = now + TICK_S * np.arange(HORIZON.stages + 1)
        for k, (p, v) in enumerate(zip(reference.position(times), reference.speed(times), strict=True)):
            table["_tvp", k, "d"], table["_tvp", k, "r"], table["_tvp", k, "s"] = told["d"], p, v
        return table

    mpc.set_tvp_fun(varying)
    with as_peers_expect():
        mpc.setup()
        mpc.x0 = np.zeros(5)
        mpc.set_initial_guess()

    def act(now: float, state: Array, force: float, command: float, rate: float) -> float:
        told["d"] = force
        mpc.t0 = now
        with as_peers_expect():
            w = float(mpc.make_step(np.append(state, command).reshape(-1, 1))[0, 0])
        return command + TICK_S * w

    return act


def converged() -> Act:
    """The MPC's own discretised problem by multiple shooting, IPOPT to its tolerance, from the shifted last solution
    and from the plan that follows the reference by inverting the model; the cheaper of the two solutions is taken.
    """
    N, n = HORIZON.stages, 4
    opti = ca.Opti()
    X, W = opti.variable(n, N + 1), opti.variable(N)
    x0, c0, w0, d, r, s = (
        opti.parameter(n),
        opti.parameter(),
        opti.parameter(),
        opti.parameter(),
        *(opti.parameter(N + 1) for _ in "rs"),
    )
    scale = np.array([1e-3, 1e-2, 1e-4, 0.1])
    x, a, b, f = ca.SX.sym("x", n), ca.SX.sym("a"), ca.SX.sym("b"), ca.SX.sym("f")
    end, m = x, HORIZON.substeps
    for j in range(m):
        end = ca.vertcat(*advance(end, a + (b - a) * j / m, a + (b - a) * (j + 1) / m, f, TICK_S / m, dict(PARAMETERS)))
    stage = ca.Function("stage", [x, a, b, f], [end])
    command, total, before = c0, 0.0, w0
    opti.subject_to(X[:, 0] == x0 / scale)
    for k in range(N):
        after = command + TICK_S * W[k]
        opti.subject_to(X[:, k + 1] == stage(X[:, k] * scale, command, after, d) / scale)
        opti.subject_to(opti.bounded(BOUNDS.low, after, BOUNDS.high))
        at = X[:, k + 1] * scale
        weight = WEIGHTS.final if k + 1 == N else 1.0
        total += (
            0.5 * weight * ((at[0] - r[k + 1]) / WEIGHTS.position_m) ** 2
            + 0.5 * ((at[1] - s[k + 1]) / WEIGHTS.speed_m_s) ** 2
        )
        total += 0.5 * (W[k] / WEIGHTS.rate_N_s) ** 2 + 0.5 * ((W[k] - before) / WEIGHTS.jump_N_s) ** 2
        command, before = after, W[k]
    opti.subject_to(opti.bounded(-BOUNDS.rate, W, BOUNDS.rate))
    opti.minimize(total)
    opti.solver("ipopt", {**QUIET, "ipopt.max_iter": 300})
    model, reference = problem_model(), Strides()
    planner = Planner(model, BOUNDS, WEIGHTS, HORIZON)
    held = {"w": np.zeros(N)}

    def solved(start: Array, path: Array) -> tuple[float, Array]:
        opti.set_initial(W, start)
        opti.set_initial(X, path.T / scale[:, None])
        try:
            found = opti.solve()
        except RuntimeError:
            return np.inf, start
        return float(found.value(total)), np.asarray(found.value(W))

    def act(now: float, state: Array, force: float, command: float, rate: float) -> float:
        times = now + TICK_S * np.arange(N + 1)
        position, speed = reference.position(times), reference.speed(times)
        for symbol, value in ((x0, state), (c0, command), (w0, rate), (d, force), (r, position), (s, speed)):
            opti.set_value(symbol, value)
        targets, best = np.vstack([position, speed, 0 * speed]), (np.inf, held["w"])
        shifted = np.append(held["w"][1:], 0.0)
        guess = command + TICK_S * np.append(0.0, np.cumsum(shifted))
        for plan in planner.candidates(Start(now, state, force), targets, guess, rate):
            found = solved(np.diff(plan.commands) / TICK_S, plan.path)
            best = min(best, found, key=lambda item: item[0])
        held["w"] = best[1]
        return command + TICK_S * float(best[1][0]) if np.isfinite(best[0]) else np.nan

    return act
