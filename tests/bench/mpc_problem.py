"""The problem on which MPCs are compared: position, speed, wall, drive force; a mismatched plant, noise, one loop for
all.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from controller.limits import Envelope, Limits
from controller.model.control_model import ControlModel, control_model
from controller.model.symbols import PURSUIT_S, Symbols
from controller.signals import Estimate
from controller.tuned import Horizon, Weights
from models.parameter import Parameter
from models.rigs.reader import parse_rig
from models.surfaces.gut import settle
from models.theta import Theta

Array = NDArray[np.float64]

TICK_S = 5e-3
SMOOTHING = 1e-3
STATES = ("x", "v", "u", "force_N")
NOISE = np.array([2e-5, 3e-4, 1e-5, 1e-4])
BOUNDS = Envelope(-0.2, 0.2, Limits(speed_m_s=5.0, force_N=20.0), 5.0)
WEIGHTS = Weights(position_m=1e-4, speed_m_s=2e-2, rate_N_s=2.0, jump_N_s=4.0)
HORIZON = Horizon(stages=30, stage_s=TICK_S, substeps=3, iterations=3, deadline_s=10.0)
PARAMETERS = {
    "coil_force_N_per_A": 1.0,
    "mass_kg": 4e-3,
    "friction_N": 45e-3,
    "excess": 0.3,
    "fade_m_s": 3e-3,
    "wall_N_per_m": 150.0,
    "slip_m": 2.5e-4,
    "lag_s": 8e-3,
}


def resistance(v: Any, p: dict[str, Any]) -> Any:
    """Coulomb friction with a Stribeck excess, N, without its sign."""
    return p["friction_N"] * (1 + p["excess"] * np.exp(-((v / p["fade_m_s"]) ** 2)))


def slope(x: Any, c: Any, d: Any, p: dict[str, Any]) -> list[Any]:
    """The right-hand side: `m v' = F + d - F_e v/(|v| + eps) - k u`, `u' = v - |v| u/u_c`, `F' = (K c - F)/tau`."""
    v, u, force = x[1], x[2], x[3]
    held = resistance(v, p) * v / (np.abs(v) + SMOOTHING) + p["wall_N_per_m"] * u
    return [
        v,
        (force + d - held) / p["mass_kg"],
        v - np.abs(v) * u / p["slip_m"],
        (p["coil_force_N_per_A"] * c - force) / p["lag_s"],
    ]


def advance(x: Any, c0: Any, c1: Any, d: Any, h: Any, p: dict[str, Any]) -> list[Any]:
    """One step of the same, friction implicit."""
    v, u, force = x[1], x[2], x[3]
    keep = np.exp(-h / p["lag_s"])
    wanted = p["coil_force_N_per_A"] * 0.5 * (c0 + c1)
    after = wanted + (force - wanted) * keep
    middle = u + 0.5 * h * (v - np.abs(v) * u / p["slip_m"])
    free = v + h / p["mass_kg"] * (0.5 * (force + after) + d - p["wall_N_per_m"] * middle)
    v_next = settle(free, resistance(v, p) * h / p["mass_kg"], SMOOTHING)
    mean = 0.5 * (v + v_next)
    return [x[0] + h * mean, v_next, (u + h * mean) / (1 + h * np.abs(mean) / p["slip_m"]), after]


def symbols() -> Symbols:
    """The problem as the control model's functions."""
    x, q = ca.SX.sym("x", 4), ca.SX.sym("q", len(PARAMETERS))
    c0, c1, d, t, h, speed = (ca.SX.sym(n) for n in ("c0", "c1", "d", "t", "h", "speed"))
    p: dict[str, Any] = {name: q[i] for i, name in enumerate(PARAMETERS)}
    new = ca.vertcat(*advance(x, c0, c1, d, h, p))

    def wall(v: Any) -> Any:
        return resistance(v, p) * v / (np.abs(v) + SMOOTHING) + p["wall_N_per_m"] * x[2]

    arguments = [x, c0, c1, d, t, h, q]
    jacobian = ca.densify(ca.jacobian(new, ca.vertcat(x, c0, c1, d)))
    pursuit = (wall(speed) - d + p["mass_kg"] * (speed - x[1]) / PURSUIT_S) / p["coil_force_N_per_A"]
    held = wall(x[1])
    return Symbols(
        STATES,
        tuple(Parameter(name, value) for name, value in PARAMETERS.items()),
        ca.Function("substep", arguments, [ca.cse(new)]),
        ca.Function("slopes", arguments, ca.cse([new, jacobian])),
        ca.Function("measured", [x, t, q], [x[0]]),
        ca.Function("wall_force", [x, t, q], [held]),
        ca.Function("wall_slopes", [x, t, q], [held, ca.densify(ca.jacobian(held, x))]),
        ca.Function("pursuit", [x, speed, d, t, q], [pursuit]),
    )


def problem_model() -> ControlModel:
    """The problem's control model, led like a coil of 1 N/A."""
    rig = parse_rig({**_TABLES, "rig": {"kind": "coil", "force_constant_N_per_A": 1.0}})
    model = control_model(rig, Theta(), TICK_S)
    return replace(model, symbols=symbols(), values=np.array(list(PARAMETERS.values())), smoothing=SMOOTHING)


_TABLES: dict[str, dict[str, Any]] = {
    "capsule": {"radius_m": 6.5e-3, "cylinder_length_m": 20e-3, "mass_kg": 4e-3},
    "tissue": {
        "preset": "jejunum",
        "wall_thickness_m": 2.5e-3,
        "contact_angle_deg": 60.0,
        "nose_force_angle_deg": 30.0,
        "friction_coefficient": 0.082,
        "mucus_thickness_m": 30e-6,
        "recovery_time_s": 0.05,
    },
}


@dataclass(frozen=True)
class Strides:
    """Forward and back by `stride_m` in `move_s` with rests of `rest_s`: a quintic each, so position, speed and
    acceleration are smooth.
    """

    stride_m: float = 4e-3
    move_s: float = 0.5
    rest_s: float = 0.25

    def _phase(self, t: Array) -> tuple[Array, Array]:
        turn = self.move_s + self.rest_s
        k = np.floor(np.maximum(t, 0.0) / turn)
        return k, np.clip((np.maximum(t, 0.0) - k * turn - self.rest_s) / self.move_s, 0.0, 1.0)

    def position(self, t: Array) -> Array:
        k, s = self._phase(t)
        rise = s**3 * (10 - 15 * s + 6 * s * s)
        return self.stride_m * np.where(k % 2 == 0, rise, 1 - rise)

    def speed(self, t: Array) -> Array:
        k, s = self._phase(t)
        return np.where(k % 2 == 0, 1.0, -1.0) * self.stride_m / self.move_s * 30 * s**2 * (1 - s) ** 2


@dataclass(frozen=True)
class Outcome:
    """A closed loop: `cost` a tick, tracking error, ms a tick by the wall's clock and by the thread's own, failures."""

    cost: float
    rmse_m: float
    wall_ms: Array
    own_ms: Array
    failed: int


Act = Callable[[float, Array, float, float, float], float]


def loop(act: Act, seconds: float, seed: int, mismatch: float = 1.15, skip: int = 10) -> Outcome:
    """`act(now, state, disturbance, command, last rate) -> command` against a plant whose friction, wall and drive are
    `mismatch` times the model's (drive divided), seen with noise; a fixed-gain observer takes up the rest. The plant
    steps 50 us, the command ramps.
    """
    rng = np.random.default_rng(seed)
    truth = {k: float(v) for k, v in PARAMETERS.items()}
    for name, factor in (("friction_N", mismatch), ("wall_N_per_m", mismatch), ("coil_force_N_per_A", 1 / mismatch)):
        truth[name] *= factor
    plant, expected = _stepper(truth, 100), _stepper(PARAMETERS, 30)
    reference, n = Strides(), round(seconds / TICK_S)
    x, seen, force, command, rate = np.zeros(4), np.zeros(4), 0.0, 0.0, 0.0
    cost, errors, wall, own, failed = 0.0, np.zeros(n), np.zeros(n), np.zeros(n), 0
    for k in range(n):
        now, reading = k * TICK_S, x + NOISE * rng.standard_normal(4)
        error = reading - seen
        state, force = (
            seen + 0.4 * error,
            float(np.clip(force + 0.15 * truth["mass_kg"] / TICK_S * error[1] + 2.0 * error[0], -0.1, 0.1)),
        )
        begin, mine = time.perf_counter(), time.thread_time()
        new = act(now, state, force, command, rate)
        wall[k], own[k] = time.perf_counter() - begin, time.thread_time() - mine
        if not math.isfinite(new):
            new, failed = command, failed + 1
        before, rate = rate, (new - command) / TICK_S
        x, seen = plant(x, command, new, 0.0), expected(state, command, new, force)
        command = new
        at = np.array(now + TICK_S)
        errors[k] = x[0] - float(reference.position(at))
        scale = WEIGHTS
        cost += 0.5 * (
            (errors[k] / scale.position_m) ** 2 + ((x[1] - float(reference.speed(at))) / scale.speed_m_s) ** 2
        )
        cost += 0.5 * ((rate / scale.rate_N_s) ** 2 + ((rate - before) / scale.jump_N_s) ** 2)
    return Outcome(cost / n, float(np.sqrt(np.mean(errors**2))), 1e3 * wall[skip:], 1e3 * own[skip:], failed)


def _stepper(p: dict[str, float], substeps: int) -> Callable[[Array, float, float, float], Array]:
    x, c0, c1, d = ca.SX.sym("x", 4), ca.SX.sym("c0"), ca.SX.sym("c1"), ca.SX.sym("d")
    h = TICK_S / substeps
    share = ca.SX.sym("share", 2)
    one = ca.Function(
        "one",
        [x, share, c0, c1, d],
        [ca.vertcat(*advance(x, c0 + share[0] * (c1 - c0), c0 + share[1] * (c1 - c0), d, h, p))],
    )
    chain = one.mapaccum(substeps)
    ends = np.linspace(0, 1, substeps + 1)
    shares = np.vstack([ends[:-1], ends[1:]])

    def step(x0: Array, a: float, b: float, force: float) -> Array:
        return np.asarray(np.array(chain(x0, shares, a, b, force))[:, -1])

    return step


def estimate(now: float, state: Array, force: float) -> Estimate:
    """What the product's controller is told."""
    return Estimate(now, state, np.zeros(4), force)
