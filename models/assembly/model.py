"""Base + drive + effects -> one CasADi model: states, parameters with bounds, step and output."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from models.assembly.effects import Active
from models.assembly.step import Stepper
from models.drives.drive import Drive
from models.effects.effect import Effect
from models.parameter import Name, Parameter
from models.rigs.columns import FURTHER, Seen
from models.surfaces.gut import LONGEST
from models.surfaces.surface import Surface

Effects = Sequence[type[Effect]]
BASE_STATES = ("x", "v", "a", "u", "slip", "u_rate", "direction", "travelled", "dwell")


@dataclass(frozen=True)
class Assembly:
    """A model ready to run, SI: `step(state, c0, c1, t, h, parameters) -> (state, output)` with named states and
    parameters, the commands `c0`, `c1` at the step's ends and the output at its end.

    `correct(state, error, gain)` shifts the hidden wall (and the capsule) towards a measurement: a fixed-gain observer
    that keeps slip events in step with measured ones.
    """

    effects: tuple[type[Effect], ...]
    states: tuple[Name, ...]
    initial: dict[Name, float]
    parameters: tuple[Parameter, ...]
    step: ca.Function
    correct: ca.Function

    def vector(self, values: Mapping[Name, float]) -> np.ndarray[Any, np.dtype[np.float64]]:
        """The parameter vector: `values` by name, the declared value where there is none."""
        return np.array([float(values.get(p.key, p.value)) for p in self.parameters])

    def start(self, **values: float) -> np.ndarray[Any, np.dtype[np.float64]]:
        """The initial state: at rest at 0 but for `values` of the base states."""
        return np.array([(self.initial | dict[Name, float](values))[name] for name in self.states])


def followed_by(effects: Effects, state: Name) -> str:
    """Where a `state` of a model with `effects` is after a long rest: "command", "position", or "" for 0."""
    if isinstance(state, str):
        return ""
    return next((e.follows.get(state[1], "") for e in effects if e.id == state[0]), "")


def effect_parameters(effects: Effects) -> tuple[Parameter, ...]:
    """The effects' parameters, each with its effect."""
    return tuple(replace(p, effect=e.id) for e in effects for p in e.parameters())


def model_states(base: Sequence[str], drive: Drive, effects: Effects) -> tuple[Name, ...]:
    """Names of the states of a model: the `base`, the drive's, the effects'."""
    own = ((drive.name, drive.states), *((e.id, e.states) for e in effects))
    return (*base, *((owner, name) for owner, states in own for name in states))


def assemble(
    surface: Surface, drive: Drive, effects: Effects = (), smoothing: float = 0.0, further: Sequence[str] = ()
) -> Assembly:
    """The body on `surface` (the gut's `Wall` or a `Plate`) under `drive`, with `effects`.

    In the gut `m a = F_act - F_e(|v|) Sgn(v) - F_v(w) - T(u)`, on a plate `m a = F_act - mu N Sgn(v)`; set-valued
    friction is solved within the step (`models.surfaces.gut.settle`), with `smoothing` in m/s for controllers that need
    derivatives: a resting body then creeps at a speed of that order. For an imposed motion the output is the pull that
    it takes, else the body's position, then the `further` columns. Raises ValueError for an imposed motion on a plate.
    """
    if drive.imposed and not surface.dragged:
        raise ValueError(f"drive must leave the body free on a plate; got {drive.name!r}, which imposes its position")
    parameters = surface.parameters() + drive.parameters() + effect_parameters(effects)
    names = model_states(BASE_STATES, drive, effects)
    state = ca.SX.sym("state", len(names))
    c0, c1, t, h = (ca.SX.sym(n) for n in ("c0", "c1", "t", "h"))
    q = ca.SX.sym("p", len(parameters))
    p = {item.key: q[i] for i, item in enumerate(parameters)}
    now: dict[Name, Any] = {name: state[i] for i, name in enumerate(names)}
    active = Active.of(effects, p, now)
    stepper = Stepper(surface, drive, active, active.link(), smoothing)
    unit, last = drive.command_unit, c0 if drive.stepped else c1
    first, last = (c0, last) if unit == 1 else (c0 / unit, last / unit)
    new, output = stepper.advance(now, first, last, t, h)
    if further:
        behind = next((new[effect.id, effect.behind] for effect in effects if effect.behind), 0.0)
        seen = Seen(output, new["v"], new["drive"], behind)
        output = ca.vertcat(output, *(FURTHER[name].shown(seen) for name in further))
    function = ca.Function("step", [state, c0, c1, t, h, q], [ca.vertcat(*(new[name] for name in names)), output])
    initial: dict[Name, float] = dict.fromkeys(names, 0.0) | {"direction": 1.0}
    return Assembly(tuple(effects), names, initial, parameters, function, _correction(surface, drive, names))


def _correction(surface: Surface, drive: Drive, names: tuple[Name, ...]) -> ca.Function:
    state, error, gain = ca.SX.sym("state", len(names)), ca.SX.sym("error"), ca.SX.sym("gain")
    now: dict[Name, Any] = {name: state[i] for i, name in enumerate(names)}
    shift = gain * error
    if drive.launched:  # place and speed, critically damped: the error of a step says as much of either
        new = now | {"x": now["x"] + 2 * shift, "v": now["v"] + shift / drive.remembers_s}
    elif not surface.dragged or not drive.anchored:
        new = now | {"x": now["x"] + shift}
    elif drive.imposed:
        shift = gain * error / surface.stiffness()
        new = now | {"u": np.clip(now["u"] + shift, -LONGEST, LONGEST)}
    else:
        new = now | {"x": now["x"] + shift, "u": np.clip(now["u"] + shift, -LONGEST / 4, LONGEST / 4)}
    return ca.Function("correct", [state, error, gain], [ca.vertcat(*(new[name] for name in names))])
