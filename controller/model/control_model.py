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

# m/s over which sticking passes into slipping: of plans, and where it must be as good as exact
SMOOTHING, SHARP_M_S = 2e-5, 1e-6
LONGEST_STEP_S = 1e-3  # of the model's integration
_LONGEST_VIBRO_S = 3e-4  # the same where an inner mass swings


@dataclass(frozen=True)
class ControlModel:
    """One tick of the rig, differentiable. All SI; x has shape (n,) in the order of `states`.

    - `states`: `x` position in m and `v` speed in m/s of the capsule, `u` wall displacement in m, `slip` of the wall (0
      sticks, else its direction), then, only where the model has them, `direction` of the last motion, `travelled` path
      in m, the drive's states and the effects', each by whose it is and its own name (`(Vibro.name, "stretch_m")`). A
      plate has no `u`, `slip`.
    - `modes`: those that only take the values -1, 0, 1; a filter must neither average nor perturb them.
    - command: `drive.commanded` (`carriage_position_m` in m, `coil_current_A` in A, `coil_voltage_V` in V, `drive_on`
      0..1).
    - disturbance: a force along +x on the capsule in N that the model lacks.

    `step(x, command, disturbance_N, t) -> x_next` goes one tick of `tick_s` with the command held; `jacobians`, same
    arguments, gives `(x_next, A (n, n), B (n, 1), E (n, 1))` with respect to x, command and disturbance. `kernels` has
    the same step compiled, many times faster (`kernels.step`). `measured(x, t) -> m` is what the position sensor shows
    of `x`, late by `delay_s`; the drive follows its command with the time constant `response_s`; `held_out_error` is by
    how much the model missed records that no fit has seen, in the measured column's unit (None: not known, or not of
    this model, as a part is left out).

    Friction is smoothed over `smoothing` m/s and solved within the step, so the step is stable at any length; a resting
    capsule creeps by up to that speed. Sub-steps are at most 1 ms (0.3 ms with an inner mass). First order: a tick of 1
    ms follows the exact stick and slip to a few percent of a cycle of stick and slip.
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
        """Names of the states in order."""
        return self.symbols.states

    @property
    def modes(self) -> tuple[Name, ...]:
        """Names of the states that are switches."""
        return tuple(name for name in self.states if name in ("slip", "direction"))

    @property
    def fitted(self) -> bool:
        """Whether its numbers are another's than the experimenter's: a fit has moved them."""
        return bool(np.any(self.values != np.array([p.value for p in self.symbols.parameters])))

    @property
    def theta(self) -> Theta:
        """Its numbers by name."""
        return Theta.of((p.key, v) for p, v in zip(self.symbols.parameters, self.values.tolist(), strict=True))

    @property
    def substeps(self) -> int:
        """Steps of the integrator within a tick."""
        longest = _LONGEST_VIBRO_S if self.drive.turning else LONGEST_STEP_S
        return max(1, math.ceil(self.tick_s / longest - 1e-9))

    @property
    def force_per_command(self) -> float:
        """Slope of the drive's force at rest in N per unit of command, always positive."""
        p = self.theta.base
        slope = p.get("coil_force_N_per_A", p.get("force_N", 1.0))
        if self.drive.gap_limit_m is not None:
            slope = p["magnet_stiffness_N_per_m"]
        return max(abs(float(slope)) / float(p.get("coil_resistance_ohm", 1.0)), 1e-6)

    def left(self, before: float, command: float) -> float:
        """From where a tick's command goes to `command`: a carriage from the one `before`, others are held."""
        return before if self.drive.anchored else command

    def index(self, name: Name) -> int:
        """Where the state `name` stands; ValueError for a state that the model does not have."""
        if name not in self.states:
            got, known = spelled(name), [*map(spelled, self.states)]
            raise ValueError(f"state must be one of the model's; got {got!r}; {nearest(got, known)}")
        return self.states.index(name)

    def initial(self, position_m: float = 0.0, command: float = 0.0) -> Array:
        """State (n,) at rest at `position_m` with `command` in force for long."""
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
        """What a `state` is at after a long rest: "command", "position", or "" for 0."""
        return followed_by(self.symbols.effects, state)

    @cached_property
    def step(self) -> ca.Function:
        """One tick, `(x, command, disturbance_N, t) -> x_next`."""
        x, c, d, t = self._arguments()
        return ca.Function("step", [x, c, d, t], [self._tick(x, c, d, t)])

    @cached_property
    def jacobians(self) -> ca.Function:
        """One tick with its derivatives, `(x, command, disturbance_N, t) -> (x_next, A, B, E)`."""
        x, c, d, t = self._arguments()
        new = self._tick(x, c, d, t)
        found = (new, *(ca.jacobian(new, by) for by in (x, c, d)))
        return ca.Function("jacobians", [x, c, d, t], ca.cse([ca.densify(one) for one in found]))

    @cached_property
    def measured(self) -> ca.Function:
        """What the position sensor shows, `(x, t) -> m`, without its delay."""
        x, _, _, t = self._arguments()
        return ca.Function("measured", [x, t], [self.symbols.measured(x, t, self.values)])

    @cached_property
    def kernels(self) -> Kernels:
        """The step as machine code, kept on disk: only the first use of a kind of model waits."""
        return compile_kernels(self.symbols, self.values, self.tick_s, self.substeps)

    @cached_property
    def sharp(self) -> ControlModel:
        """This model with friction as sharp as it is, for estimating and inverting: rounded over 50 um/s, friction at 1
        mm/s is 5 % too low and the path runs 0.5 mm ahead of the exact stick and slip, over 1 um/s by 0.04 mm.
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
    m/s what friction is rounded over, `driven` the column that is commanded where there are several. What `values` lack
    keeps the rig file's number; an effect of amplitude 0 is left out, as are `HELD_OUT`, how late a switch was logged
    and a free curve over speed. Raises ValueError for a rig without a free capsule, an unknown name, a value that is no
    finite number.
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
        if name in (*OF_THE_LOG, HELD_OUT):
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
    """The effects that `values` gives an amplitude to, but for a free curve over speed: it mends a prediction, but its
    slopes from knot to knot would make an inverse of friction that falls where the tissue's does not.
    """
    ids = sorted(values.effects)
    for name in ids:
        if name not in known or kind not in known[name].kinds:
            choices = [e for e, effect in known.items() if kind in effect.kinds]
            raise ValueError(f"values must name effects of a {kind} rig; got {name!r}; {nearest(name, choices)}")
    left = [known[name] for name in ids if name != LevelOverSpeed.id]
    return tuple(effect for effect in left if values.get((effect.id, effect.amplitude().name), 0.0) != 0)
