"""Base + drive + effects -> one CasADi model: states, parameters with bounds, step and output; what everything else reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from models.drives.drive import Drive
from models.effects.effect import Effect, Signals
from models.laws.mucus import mucus_drag
from models.parameter import Parameter
from models.wall import LONGEST, Drag, Wall, base_parameters, drag_rate, settle, step_drag

BASE_STATES = ("x", "v", "a", "u", "slip", "u_rate", "direction", "travelled", "dwell")
_STIFFEST = 1e-7  # m/N, compliance of a link below which it counts as rigid
_REST = 1e-7  # m/s, below it the capsule counts as at rest for the direction of the last motion


@dataclass(frozen=True)
class Assembly:
    """A model ready to run: `step(state, c0, c1, t, h, parameters) -> (state, output)` with named states and parameters.

    `correct(state, error, gain)` shifts the hidden wall (and the capsule) towards a measurement: a fixed-gain observer that keeps the
    teeth of the stick-slip saw in step with measured ones. `c0`, `c1` are the command at the step's ends; the output belongs to the step's end. All entries SI.
    """

    states: tuple[str, ...]
    initial: dict[str, float]
    parameters: tuple[Parameter, ...]
    step: ca.Function
    correct: ca.Function

    def vector(self, values: Mapping[str, float]) -> np.ndarray[Any, np.dtype[np.float64]]:
        """The parameter vector: `values` by name, the declared value where there is none."""
        return np.array([float(values.get(p.name, p.value)) for p in self.parameters])


@dataclass(frozen=True)
class _Active:
    """The chosen effects with their symbols, asked together."""

    effects: tuple[type[Effect], ...]
    p: Mapping[str, Any]
    z: Mapping[str, Any]

    def _own(self, effect: type[Effect], table: Mapping[str, Any]) -> dict[str, Any]:
        head = f"{effect.id}."
        return {key.removeprefix(head): value for key, value in table.items() if key.startswith(head)}

    def product(self, hook: str, s: Signals) -> Any:
        total: Any = 1.0
        for e in self.effects:
            total = total * getattr(e(), hook)(s, self._own(e, self.p), self._own(e, self.z))
        return total

    def total(self, hook: str, s: Signals) -> Any:
        total: Any = 0.0
        for e in self.effects:
            total = total + getattr(e(), hook)(s, self._own(e, self.p), self._own(e, self.z))
        return total

    def command(self, s: Signals) -> Any:
        for e in self.effects:
            s = replace(s, command=e().command(s, self._own(e, self.p), self._own(e, self.z)))
        return s.command

    def measured(self, s: Signals, y: Any) -> Any:
        for e in self.effects:
            y = e().measured(s, self._own(e, self.p), self._own(e, self.z), y)
        return y

    def recovery(self, s: Signals, speed: Any, onset: Any) -> Any:
        for e in self.effects:
            speed = e().recovery(s, self._own(e, self.p), self._own(e, self.z), speed, onset)
        return speed

    def advance(self, s: Signals, h: Any) -> _Active:
        z = dict(self.z)
        for e in self.effects:
            for name, value in e().advance(s, self._own(e, self.p), self._own(e, z), h).items():
                z[f"{e.id}.{name}"] = value
        return replace(self, z=z)

    def follow(self, s: Signals, y: Any, h: Any) -> dict[str, Any]:
        z = dict(self.z)
        for e in self.effects:
            for name, value in e().follow(s, self._own(e, self.p), self._own(e, self.z), y, h).items():
                z[f"{e.id}.{name}"] = value
        return z


def effect_parameters(effects: Sequence[type[Effect]]) -> tuple[Parameter, ...]:
    """The effects' parameters under their full names `effect_id.name`."""
    return tuple(replace(p, name=f"{e.id}.{p.name}") for e in effects for p in e.parameters())


def assemble_gut(wall: Wall, drive: Drive, effects: Sequence[type[Effect]] = (), smoothing: float = 0.0) -> Assembly:
    """The capsule in the gut under `drive`: the base model of stick and slip plus `effects`.

    `m a = F_act - F_e(|v|) Sgn(v) - F_v(w) - T(u)`; set-valued friction is solved within the step (`models.wall.settle`), with
    `smoothing` in m/s for controllers that need derivatives. For an imposed motion the output is the pull that it takes.
    """
    parameters = base_parameters(wall.tissue) + drive.parameters() + effect_parameters(effects)
    hidden = tuple(f"{e.id}.{name}" for e in effects for name in e.states)
    names = BASE_STATES + hidden
    state = ca.SX.sym("state", len(names))
    c0, c1, t, h = (ca.SX.sym(n) for n in ("c0", "c1", "t", "h"))
    q = ca.SX.sym("p", len(parameters))
    p = {item.name: q[i] for i, item in enumerate(parameters)}
    now = {name: state[i] for i, name in enumerate(names)}
    active = _Active(tuple(effects), p, {name: now[name] for name in hidden})
    compliance = p.get("string_compliance.compliance_m_per_N")
    new, output = _step(wall, drive, active, compliance, now, (c0, c1, t, h), smoothing)
    function = ca.Function("step", [state, c0, c1, t, h, q], [ca.vertcat(*(new[name] for name in names)), output])
    initial = dict.fromkeys(names, 0.0) | {"direction": 1.0}
    return Assembly(names, initial, parameters, function, _correction(wall, drive, names))


def _correction(wall: Wall, drive: Drive, names: tuple[str, ...]) -> ca.Function:
    state, error, gain = ca.SX.sym("state", len(names)), ca.SX.sym("error"), ca.SX.sym("gain")
    now = {name: state[i] for i, name in enumerate(names)}
    if drive.imposed:
        shift = gain * error / wall.stiffness()
        new = now | {"u": np.clip(now["u"] + shift, -LONGEST, LONGEST)}
    else:
        shift = gain * error
        new = now | {"x": now["x"] + shift, "u": np.clip(now["u"] + shift, -LONGEST / 4, LONGEST / 4)}
    return ca.Function("correct", [state, error, gain], [ca.vertcat(*(new[name] for name in names))])


def _step(
    wall: Wall, drive: Drive, active: _Active, compliance: Any, now: dict[str, Any], at: tuple[Any, ...], smoothing: float
) -> tuple[dict[str, Any], Any]:
    c0, c1, t, h = at
    p, t_r = active.p, wall.tissue.recovery_time_s
    m = wall.capsule.mass_kg
    drag = Drag(now["u"], now["slip"])
    rate = (c1 - c0) / h
    imposed = drive.imposed and compliance is None
    T_quiet = wall.tension(drag.u if imposed else drag.u + 0.5 * h * now["u_rate"])
    v_now = rate if imposed else now["v"] + 0.5 * h * now["a"]
    x_now = now["x"] if imposed else now["x"] + 0.5 * h * now["v"]
    s = Signals(t, x_now, v_now, now["direction"], c1, rate, now["travelled"], T_quiet, drag.u, now["u_rate"], now["dwell"])
    active_next = active.advance(s, h)
    command = active_next.command(s)
    if imposed:
        v_now = (command - now["x"]) / h
    s = replace(s, v=v_now, direction=np.where(np.abs(v_now) > _REST, np.sign(v_now), now["direction"]))
    F_e, f_c = wall.grip(np.abs(v_now), p["hoop_stress_factor"], p["friction_coefficient"], active.product("level", s))
    stiff = active.product("stiffening", s)
    u_c = wall.drag_at(f_c / stiff)
    v_i = active.recovery(s, u_c / t_r, u_c)
    s = replace(s, drag_rate=drag_rate(drag, v_now, v_i))
    T = T_quiet * stiff + active.total("wall_force", s)
    F_v = mucus_drag(np.where(drag.slip == 0, 0.0, v_now - s.drag_rate), wall.tissue.mucus_thickness_m)
    outside = active.total("force", s)
    if imposed:
        x_next, v_next = command, v_now
    else:
        F_act = 0.0 if drive.imposed else active.product("gain", s) * drive.force(x_now, v_now, command - 0.5 * h * rate, p)
        free, stop = now["v"] + h / m * (F_act + outside - F_v - T), F_e * h / m
        if drive.imposed:
            give = h * h / m / (compliance + h * h / m)  # the link's share of the step, solved implicitly
            free, stop = free * (1 - give) + give * (command - now["x"]) / h, stop * (1 - give)
        v_next = settle(free, stop, smoothing)
        x_next = now["x"] + 0.5 * h * (now["v"] + v_next)
    v_mean = v_next if imposed else 0.5 * (now["v"] + v_next)
    dragged = step_drag(drag, v_mean, h, f_c, lambda u: wall.tension(u) * stiff, v_i)
    s = replace(s, t=t + h, drag_rate=drag_rate(dragged, v_next, v_i))
    if imposed:
        F_v = mucus_drag(np.where(dragged.slip == 0, 0.0, v_next - s.drag_rate), wall.tissue.mucus_thickness_m)
        output = F_e * s.direction + F_v + wall.tension(dragged.u) * stiff + active.total("wall_force", s) - outside
    else:
        output = (command - x_next) / np.maximum(compliance, _STIFFEST) if drive.imposed else x_next
    moving = np.abs(v_next) > _REST
    new = {
        "x": x_next,
        "v": v_next,
        "a": (v_next - now["v"]) / h,
        "u": dragged.u,
        "slip": dragged.slip,
        "u_rate": s.drag_rate,
        "direction": np.where(moving, np.sign(v_next), now["direction"]),
        "travelled": now["travelled"] + np.abs(v_next) * h,
        "dwell": np.where(moving, 0.0, now["dwell"] + h),
    }
    seen = replace(active_next, z=active_next.follow(s, output, h))
    return new | dict(seen.z), seen.measured(s, output)
