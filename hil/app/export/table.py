"""Friction over speed, direction and place, as a found model has it in steady sliding."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hil.app.export.found import Found
from models.assembly.effects import Active
from models.assembly.step import Stepper
from models.effects import CATALOGUE
from models.effects.effect import Effect, Signals
from models.surfaces.gut import Drag
from models.theta import Theta

Array = NDArray[np.float64]
SPEEDS_M_S: Final = (2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2)  # at which friction is tabled
PLACES_M: Final = tuple(np.round(np.linspace(-0.02, 0.08, 101), 6).tolist())
UNITS: Final[Mapping[str, str]] = {
    "speed_m_s": "m/s, of the capsule along the surface, positive",
    "direction": "1: towards +x, -1: towards -x",
    "place_m": "m, along the lumen",
    "friction_N": "N against the motion while the wall does not pull: F_e, or Coulomb's friction",
    "mucus_N": "N against the motion, drag of the film at this speed",
    "others_N": "N against the motion, effects' forces that depend on speed, direction and place",
    "wall_limit_N": "N, slip limit f_c of the dragged wall, 0 on a plate",
    "force_N": "N against the motion, mean of the saw: friction + others + half of the wall's limit",
    "peak_N": "N against the motion before the wall slips: friction + others + the wall's limit",
}
_TIME: Final = "depends on time, rest, path or a memory of its own; it is left out"
_ELSEWHERE: Final = "acts on {}, not on the friction"
_ROLES: Final = {
    "command": "the command",
    "response": "the command",
    "gain": "the drive's force",
    "measured": "the measurement",
    "delay": "the measurement",
    "suspension": "the inner mass",
    "reach": "the inner mass's coil",
    "stiffening": "the wall's tension",
    "wall_force": "the wall's tension",
    "recovery": "the wall's draw-back",
}


@dataclass(frozen=True)
class FrictionTable:
    """`columns` of one length, their meaning in `UNITS`; `not_mapped` says what of the model is not in them and why."""

    columns: dict[str, Array]
    not_mapped: dict[str, str]


def friction_table(found: Found) -> FrictionTable:
    """The model's friction at `SPEEDS_M_S`, both directions and `PLACES_M`; SI, forces against the motion."""
    mapped = [e for e in found.effects if _steady(e) and _acts(e)]
    law = _law(found, tuple(mapped))
    grid = np.array([(v, d, x) for d in (1.0, -1.0) for v in SPEEDS_M_S for x in PLACES_M])
    friction, mucus, others, limit = np.array(law(grid.T))
    columns = {
        **dict(zip(("speed_m_s", "direction", "place_m"), grid.T, strict=True)),
        "friction_N": friction,
        "mucus_N": mucus,
        "others_N": others,
        "wall_limit_N": limit,
        "force_N": friction + others + 0.5 * limit,
        "peak_N": friction + others + limit,
    }
    return FrictionTable(columns, not_mapped(found))


def not_mapped(found: Found) -> dict[str, str]:
    """The effects that a law of friction over speed, direction and place does not hold, and what is lost with it."""
    missing = found.late()
    for e in found.effects:
        if not _acts(e):
            missing.setdefault(e.id, _ELSEWHERE.format(next(_ROLES[h] for h in _ROLES if e.answers(h))))
        elif not _steady(e):
            missing[e.id] = _TIME
    if found.surface.dragged:
        missing["stick and slip of the wall"] = "the saw's mean and peak are here, its course in time is not"
    return missing


def _acts(effect: type[Effect]) -> bool:
    return any(effect.answers(hook) for hook in ("level", "shared", "force", "normal_load"))


def _steady(effect: type[Effect]) -> bool:
    """Whether what an effect adds to friction follows from speed, direction and place alone."""
    names = ("t", "travelled", "dwell", "tension", "drag", "drag_rate", "rate", "load")
    history = {name: ca.SX.sym(name) for name in names}
    owners = [effect, *([CATALOGUE[effect.of]] if effect.of else [])]
    p = {q.name: ca.SX.sym(q.name) for owner in owners for q in owner.parameters()}
    z = {name: ca.SX.sym(name) for name in effect.states}
    s = Signals(x=ca.SX.sym("x"), v=ca.SX.sym("v"), direction=ca.SX.sym("d"), command=0.0, **history)
    asked = [getattr(effect(), hook)(s, p, z) for hook in ("level", "force", "normal_load")]
    told = ca.vertcat(*(ca.SX(value) for value in asked))
    return not any(ca.depends_on(told, symbol) for symbol in (*history.values(), *z.values()))


def _law(found: Found, effects: tuple[type[Effect], ...]) -> Any:
    """Numbers (4, n) of friction, mucus, other forces and the wall's limit in N, of (3, n) speed, direction, place."""
    v, d, x = (ca.SX.sym(name) for name in ("v", "d", "x"))
    z = Theta.of(((e.id, name), 0.0) for e in effects for name in e.states)
    stepper = Stepper(found.surface, found.drive, Active(effects, found.numbers, z))
    s = Signals(x=x, v=v * d, direction=d, command=found.drive.neutral(x))
    grip = stepper.grip(s)
    _, mucus = stepper.wall_forces(replace(s, drag_rate=0.0), Drag(0.0, d), 0.0)
    others = -d * stepper.active.total("force", s)
    row = ca.vertcat(*(ca.SX(value) for value in (grip.friction, d * mucus, others, grip.onset)))
    function = ca.Function("law", [v, d, x], [row])
    return lambda grid: np.asarray(function.map(grid.shape[1])(*(g[None, :] for g in grid)))
