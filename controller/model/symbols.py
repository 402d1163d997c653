"""One sub-step of the smoothed model in CasADi symbols, reduced to the states that matter."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from models.assembly.effects import Active
from models.assembly.model import effect_parameters, model_states
from models.assembly.step import Stepper
from models.drives.drive import Drive
from models.effects.effect import Effect, Signals
from models.parameter import Name, Parameter
from models.surfaces.gut import Drag, drag_rate
from models.surfaces.surface import Surface
from models.theta import spelled

_BASE = ("x", "v", "u", "slip", "direction", "travelled", "dwell")
PURSUIT_S = 0.02  # time in which a command brings the capsule to its speed


@dataclass(frozen=True)
class Unmodelled(Effect):
    """A force along +x that the model lacks: the input of an observer's disturbance."""

    id: ClassVar[str] = "unmodelled"
    force_N: Parameter = Parameter("force_N", 0.0, "N", source="estimated while running")

    def force(self, s: Signals, p: Mapping[str, Any], z: Mapping[str, Any]) -> Any:
        return p["force_N"]


@dataclass(frozen=True)
class Symbols:
    """A model's functions of states `x` (n,), commands at a sub-step's ends `c0`, `c1`, disturbance `d` in N, time `t`
    and step `h` in s, parameters `q` in the order of `parameters`.

    - `substep(x, c0, c1, d, t, h, q) -> x_next`, `slopes(...) -> (x_next, J (n, n + 3))` with the derivatives by x, c0,
      c1, d.
    - `measured(x, t, q) -> m`.
    - `wall_force(x, t, q) -> N`: the wall's force against +x, resistance, mucus and tension; `wall_slopes(...) -> (N,
      dN/dx (1, n))`.
    - `pursuit(x, speed, d, t, q) -> command` that brings the capsule to `speed` in m/s within `PURSUIT_S` with an
      immediate drive.
    """

    states: tuple[Name, ...]
    parameters: tuple[Parameter, ...]
    substep: ca.Function
    slopes: ca.Function
    measured: ca.Function
    wall_force: ca.Function
    wall_slopes: ca.Function
    pursuit: ca.Function
    effects: tuple[type[Effect], ...] = ()


@dataclass(frozen=True)
class _Model:
    """The parts with their symbols; `now` has a symbol per state."""

    surface: Surface
    drive: Drive
    effects: tuple[type[Effect], ...]
    smoothing: float
    p: Mapping[Name, Any]
    d: Any
    now: Mapping[Name, Any]

    def stepper(self) -> Stepper:
        """The assembled model's step with the disturbance among its effects."""
        p = {**self.p, ("unmodelled", "force_N"): self.d}
        active = Active.of((*self.effects, Unmodelled), p, self.now)
        return Stepper(self.surface, self.drive, active, None, self.smoothing)

    def signals(self, stepper: Stepper, t: Any, command: Any = None) -> Signals:
        """The effects' view of the present state, under a `command` without force if none is given."""
        n = self.now
        given = self.drive.neutral(n["x"]) if command is None else command
        place = (n["x"], n["v"], n["direction"], given, 0.0, n["travelled"])
        s = Signals(t, *place, stepper.tension(n["u"]), n["u"], 0.0, n["dwell"])
        rate = 0.0 if not self.surface.dragged else drag_rate(Drag(n["u"], n["slip"]), n["v"], stepper.grip(s).recovery)
        return replace(s, drag_rate=rate)

    def advance(self, c0: Any, c1: Any, t: Any, h: Any) -> dict[Name, Any]:
        """The states a sub-step later. They have no rates, unlike the assembled model's: those follow from the rest."""
        stepper = self.stepper()
        rate = self.signals(stepper, t, c0).drag_rate
        new, _ = stepper.advance({**self.now, "a": 0.0, "u_rate": rate}, c0, c1, t, h)
        return new

    def measured(self, t: Any) -> Any:
        stepper = self.stepper()
        return stepper.active.through("measured", self.signals(stepper, t), self.now["x"])

    def wall_force(self, t: Any) -> Any:
        """`F_e v/(|v| + eps) + T(u) + F_v(w)` in N, on a plate Coulomb friction alone."""
        stepper = self.stepper()
        s = self.signals(stepper, t)
        grip = stepper.grip(s)
        tension, mucus = stepper.wall_forces(s, Drag(self.now["u"], self.now["slip"]), s.tension)
        return grip.friction * s.v / (np.abs(s.v) + self.smoothing) + tension + mucus

    def pursuit(self, speed: Any, t: Any) -> Any:
        """Command that moves the capsule at `speed` against the present wall and all other forces."""
        v = self.now["v"]
        moving = replace(self, now={**self.now, "v": speed, "direction": np.sign(speed)})
        stepper = moving.stepper()
        s = moving.signals(stepper, t)
        inertia = stepper.surface.body_kg * (speed - v) / PURSUIT_S
        force = moving.wall_force(t) - stepper.active.total("force", s) + inertia
        force = force / stepper.active.product("gain", s)
        return ca.SX(self.drive.command_for(force, self.now["x"], v, stepper.active.p.base))


def assembled(surface: Surface, drive: Drive, effects: Sequence[type[Effect]], smoothing: float) -> Symbols:
    """The functions of a body on `surface` under `drive` with `effects`, reduced to the states that matter."""
    parameters = surface.parameters() + drive.parameters() + effect_parameters(effects)
    q = ca.SX.sym("q", len(parameters))
    c0, c1, d, t, h = (ca.SX.sym(name) for name in ("c0", "c1", "d", "t", "h"))
    names = model_states(_BASE, drive, effects)
    now = {name: ca.SX.sym(spelled(name)) for name in names}
    p = {item.key: q[i] for i, item in enumerate(parameters)}
    model = _Model(surface, drive, tuple(effects), smoothing, p, d, now)
    unit = drive.command_unit
    last = c0 if drive.held else c1
    new = model.advance(c0 / unit, last / unit, t, h)
    reading, wall = (ca.densify(ca.SX(e)) for e in (model.measured(t), model.wall_force(t)))
    kept = _needed(names, now, new, ca.vertcat(reading, wall))
    x = ca.vertcat(*(now[name] for name in kept))
    after = ca.densify(ca.cse(ca.vertcat(*(new[name] for name in kept))))
    arguments = [x, c0, c1, d, t, h, q]
    speed = ca.SX.sym("speed")
    pursuit = ca.densify(ca.SX(model.pursuit(speed, t)) * unit)
    jacobian = ca.densify(ca.jacobian(after, ca.vertcat(x, c0, c1, d)))
    return Symbols(
        kept,
        parameters,
        ca.Function("substep", arguments, [after]),
        ca.Function("slopes", arguments, ca.cse([after, jacobian])),
        ca.Function("measured", [x, t, q], [reading]),
        ca.Function("wall_force", [x, t, q], [ca.cse(wall)]),
        ca.Function("wall_slopes", [x, t, q], ca.cse([wall, ca.densify(ca.jacobian(wall, x))])),
        ca.Function("pursuit", [x, speed, d, t, q], [ca.cse(pursuit)]),
        tuple(effects),
    )


def _needed(
    names: tuple[Name, ...], now: Mapping[Name, ca.SX], new: Mapping[Name, Any], outputs: ca.SX
) -> tuple[Name, ...]:
    """Position, speed, the outputs' states, and every state that one of these depends on."""
    kept = {name for name in names if name in ("x", "v") or ca.depends_on(outputs, now[name])}
    while True:
        rest = ca.vertcat(*(new[name] for name in kept))
        more = {name for name in names if name not in kept and ca.depends_on(rest, now[name])}
        if not more:
            return tuple(name for name in names if name in kept)
        kept |= more
