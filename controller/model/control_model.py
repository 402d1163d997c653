"""The model that estimator, feedforward and MPC predict with: one stage of a model file, smoothed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from controller.model.kernels import Kernels, compile_kernels
from controller.model.symbols import Symbols, assembled
from controller.signals import Array
from models.assembly.model import followed_by
from models.drives.coil import ELECTRICAL
from models.drives.drive import Drive
from models.effects import Catalogue
from models.effects.effect import Effect
from models.effects.refinements import LevelOverSpeed
from models.identification.kinds.series.drive_input import OF_THE_LOG
from models.identification.model import HELD_OUT
from models.parameter import Name, nearest
from models.rigs.kinds import drive_of, surface_of
from models.rigs.rig import Rig
from models.theta import Theta, spelled

# m/s over which stick passes into slip: of plans, and for nearly exact friction
SMOOTHING, SHARP_M_S = 2e-5, 1e-6
LONGEST_STEP_S = 1e-3  # of the model's integration
_LONGEST_VIBRO_S = 3e-4  # the same where an inner mass swings


@dataclass(frozen=True)
class ControlModel:
    """One tick of the rig, differentiable. All SI; x has shape (n,) in the order of `states`.

    - `states`: `x` position in m and `v` speed in m/s of the capsule, `u` wall displacement in m, `slip` of the wall (0
      sticks, else its direction). Then, if the model has them, `direction` of the last motion, `travelled` path in m,
      and the states of drive and effects, each with owner and name (`(Vibro.name, "stretch_m")`). A plate has no `u`,
      `slip`.
    - `modes`: states with the values -1, 0, 1 only; a filter must neither average nor perturb them.
    - command: `drive.commanded` (`carriage_position_m` in m, `coil_current_A` in A, `coil_voltage_V` in V, `drive_on`
      0..1).
    - disturbance: a force along +x on the capsule in N that the model lacks.

    `step(x, command, disturbance_N, t) -> x_next` goes one tick of `tick_s` with the command held. `jacobians`, same
    arguments, gives `(x_next, A (n, n), B (n, 1), E (n, 1))` with respect to x, command and disturbance. `kernels` has
    the same step compiled, many times faster. `measured(x, t) -> m` is the position sensor's reading
    of `x`, late by `delay_s`. The drive follows its command with the time constant `response_s`. `held_out_error`: the
    model's error on held-out records in the measured column's unit (None: unknown, or of a model with another effect).

    Friction is smoothed over `smoothing` m/s and solved within the step, so the step is stable at any length; a resting
    capsule creeps by up to that speed. Sub-steps are at most 1 ms (0.3 ms with an inner mass). First order: a tick of 1
    ms follows the exact stick and slip to a few percent of a cycle.
    """

    rig: Rig
    drive: Drive
    symbols: Symbols
    values: Array
    tick_s: float
    smoothing: float
    delay_s: float
    response_s: float = 0.0
    held_out_error: float | None = None

    @property
    def states(self) -> tuple[Name, ...]:
        return self.symbols.states

    @property
    def modes(self) -> tuple[Name, ...]:
        return tuple(name for name in self.states if name in ("slip", "direction"))

    @property
    def fitted(self) -> bool:
        return bool(np.any(self.values != np.array([p.value for p in self.symbols.parameters])))

    @property
    def theta(self) -> Theta:
        return Theta.of((p.key, v) for p, v in zip(self.symbols.parameters, self.values.tolist(), strict=True))

    @property
    def substeps(self) -> int:
        longest = _LONGEST_VIBRO_S if self.drive.turning else LONGEST_STEP_S
        return max(1, math.ceil(self.tick_s / longest - 1e-9))

    @property
    def force_per_command(self) -> float:
        """Slope of the drive's force at rest in N per unit of command, positive."""
        p = self.theta.base
        slope = p.get("coil_force_N_per_A", p.get("force_N", 1.0))
        if self.drive.gap_limit_m is not None:
            slope = p["magnet_stiffness_N_per_m"]
        return max(abs(float(slope)) / float(p.get("coil_resistance_ohm", 1.0)), 1e-6)

    def command_from(self, before: float, command: float) -> float:
        """The start of a tick's command that ends at `command`: a carriage moves from `before`, other drives hold."""
        return before if self.drive.anchored else command

    def index(self, name: Name) -> int:
        """Position of the state `name`; ValueError for a state that the model does not have."""
        if name not in self.states:
            got, known = spelled(name), [*map(spelled, self.states)]
            raise ValueError(f"state must be one of the model's; got {got!r}; {nearest(got, known)}")
        return self.states.index(name)

    def initial(self, position_m: float = 0.0, command: float = 0.0) -> Array:
        """State (n,) at rest at `position_m` after a long time under `command`."""
        x = np.zeros(len(self.states))
        for k, name in enumerate(self.states):
            if name == "x" or self.followed_by(name) == "position":
                x[k] = position_m
            elif name == "direction":
                x[k] = 1.0
            elif self.followed_by(name) == "command":
                x[k] = command
        return x

    def followed_by(self, state: Name) -> str:
        """The value of a `state` after a long rest: "command", "position", or "" for 0."""
        return followed_by(self.symbols.effects, state)

    @cached_property
    def step(self) -> ca.Function:
        x, c, d, t = self._arguments()
        return ca.Function("step", [x, c, d, t], [self._tick(x, c, d, t)])

    @cached_property
    def jacobians(self) -> ca.Function:
        x, c, d, t = self._arguments()
        new = self._tick(x, c, d, t)
        found = (new, *(ca.jacobian(new, by) for by in (x, c, d)))
        return ca.Function("jacobians", [x, c, d, t], ca.cse([ca.densify(one) for one in found]))

    @cached_property
    def measured(self) -> ca.Function:
        x, _, _, t = self._arguments()
        return ca.Function("measured", [x, t], [self.symbols.measured(x, t, self.values)])

    @cached_property
    def placed(self) -> bool:
        """Whether the localisation reads the position itself."""
        x, t = ca.SX.sym("x", len(self.states)), ca.SX.sym("t")
        return bool(ca.is_equal(ca.simplify(self.measured(x, t)), x[0], 2))

    @cached_property
    def kernels(self) -> Kernels:
        """The step as machine code, cached on disk: only the first use of a kind of model waits."""
        return compile_kernels(self.symbols, self.values, self.tick_s, self.substeps)

    @cached_property
    def sharp(self) -> ControlModel:
        """This model with sharp friction, for estimation and inversion. Smoothed over 50 um/s, friction at 1 mm/s is 5
        % too low and the path runs 0.5 mm ahead of the exact stick and slip, over 1 um/s by 0.04 mm.
        """
        sharp = control_model(self.rig, self.theta, self.tick_s, min(SHARP_M_S, self.smoothing), self.drive.commanded)
        return replace(sharp, held_out_error=self.held_out_error)

    def _arguments(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        return ca.SX.sym("x", len(self.states)), ca.SX.sym("command"), ca.SX.sym("disturbance_N"), ca.SX.sym("t")

    def _tick(self, x: ca.SX, c: ca.SX, d: ca.SX, t: ca.SX) -> ca.SX:
        h = self.tick_s / self.substeps
        for k in range(self.substeps):
            x = self.symbols.substep(x, c, c, d, t + k * h, h, self.values)
        return x


def control_model(
    rig: Rig, values: Mapping[Name, float], tick_s: float, smoothing: float = SMOOTHING, driven: str = ""
) -> ControlModel:
    """The model of `rig` with `values`, one stage of a model file; `tick_s` in s is the controller's, `smoothing` in
    m/s that of friction, `driven` the commanded column if there are several. Missing `values` keep the rig file's
    number. Effects of amplitude 0, `HELD_OUT`, the delay of a logged switch, a coil's numbers that the drive does not
    command by, and a free curve over speed are left out.
    Raises ValueError for a rig without a free capsule, an unknown name, a value not finite.
    """
    drive = drive_of(rig, driven)
    if drive.imposed:
        raise ValueError(
            f"rig must be of a kind whose capsule is free (magnetic, coil, vibro) to be controlled; got {rig.kind!r}"
        )
    if not 1e-5 <= tick_s <= 1.0:
        raise ValueError(f"tick_s must lie in [1e-5, 1] s; got {tick_s:g}")
    if not 1e-7 <= smoothing <= 1e-2:
        raise ValueError(f"smoothing must lie in [1e-7, 1e-2] m/s; got {smoothing:g}")
    theta = Theta.of(values)
    effects = _effects(rig.kind, theta, Catalogue.of(rig))
    symbols = assembled(surface_of(rig), drive, effects, smoothing)
    numbers = Theta.declared(symbols.parameters)
    given = theta.only([e.id for e in effects])
    for name, value in given.items():
        if name in (*OF_THE_LOG, HELD_OUT) or (name in ELECTRICAL and name not in numbers):
            continue
        got, known = spelled(name), [*map(spelled, numbers)]
        if name not in numbers:
            raise ValueError(f"values must name the model's parameters; got {got!r}; {nearest(got, known)}")
        if not math.isfinite(value):
            raise ValueError(f"values must be finite numbers; got {got} = {value}")
    numbers |= given
    own = [(e(), numbers.effects[e.id]) for e in effects]
    delay = sum(float(effect.delay(its)) for effect, its in own)
    response = sum(float(effect.response(its)) for effect, its in own)
    vector = np.array([float(numbers[p.key]) for p in symbols.parameters])
    corrected = any(theta.effects.get(LevelOverSpeed.id, {}).values())
    error = None if corrected else theta.get(HELD_OUT)
    return ControlModel(rig, drive, symbols, vector, float(tick_s), float(smoothing), delay, response, error)


def _effects(kind: str, values: Theta, known: Catalogue) -> tuple[type[Effect], ...]:
    """The effects with an amplitude in `values`, except a free curve over speed. It improves a prediction, but its
    slopes from knot to knot would make friction fall in the inverse where the tissue's does not.
    """
    ids = sorted(values.effects)
    for name in ids:
        if name not in known or kind not in known[name].kinds:
            choices = [e for e, effect in known.items() if kind in effect.kinds]
            raise ValueError(f"values must name effects of a {kind} rig; got {name!r}; {nearest(name, choices)}")
    left = [known[name] for name in ids if name != LevelOverSpeed.id]
    return tuple(effect for effect in left if values.get((effect.id, effect.amplitude().name), 0.0) != 0)


LEAST_OFF_N = 1e-4  # for any model
AT_FIRST = 5.0  # factor on the proved error at the start


def mean_friction(model: ControlModel, speed_m_s: float = 1e-3) -> float:
    """Friction in N: `F_e + f_c/2` at `speed_m_s`, the mean of the saw-tooth; on a plate Coulomb's."""
    return float(mean_frictions(model, np.array([speed_m_s]))[0])


def mean_frictions(model: ControlModel, speeds_m_s: Array) -> Array:
    """The same at each of `speeds_m_s` (n,)."""
    p = model.theta.base
    surface = surface_of(model.rig)
    pressing = model.drive.pressing(0.0, 0.0, p)
    friction, onset = surface.hold(speeds_m_s, p, model.drive.carried_kg, pressing=pressing)
    return np.asarray(np.broadcast_to(friction + 0.5 * onset, speeds_m_s.shape))


def proved_off(model: ControlModel) -> float | None:
    """Error in N of the forces of `model` on held-out records, at least `LEAST_OFF_N`: with a magnet the position's
    error times its stiffness; None for other drives and if unknown.
    """
    if model.held_out_error is None or model.drive.gap_limit_m is None:
        return None
    return max(model.held_out_error * model.force_per_command, LEAST_OFF_N)


def level_off(model: ControlModel) -> float | None:
    """The same as a share of the mean friction."""
    off = proved_off(model)
    return None if off is None else off / mean_friction(model)
