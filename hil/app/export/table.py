"""Friction over speed, direction and position, as a found model has it in steady sliding."""

from dataclasses import dataclass, replace
from typing import Any, Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hil.app.export.found import TEXT, Found
from models.assembly.effects import Active
from models.assembly.step import Stepper
from models.effects import CATALOGUE
from models.effects.effect import Effect, Signals
from models.surfaces.gut import Drag
from models.theta import Theta

Array = NDArray[np.float64]
SPEEDS_M_S: Final = (2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2)  # at which friction is tabled
PLACES_M: Final = tuple(np.round(np.linspace(-0.02, 0.08, 101), 6).tolist())
_HOOKS: Final = (
    "command", "response", "gain", "measured", "delay", "suspension", "reach", "stiffening", "wall_force", "recovery",
)  # fmt: skip
"""By which an effect acts on something else than friction."""


@dataclass(frozen=True)
class FrictionTable:
    """`columns` of one length; `not_mapped` says what of the model is not in them and why."""

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


def tabled() -> dict[str, tuple[float, float]]:
    """The ranges of speed and place of such a table, by the names of signals."""
    return {"v_m_s": (-SPEEDS_M_S[-1], SPEEDS_M_S[-1]), "x_m": (PLACES_M[0], PLACES_M[-1])}


def not_mapped(found: Found) -> dict[str, str]:
    """The effects that a law of friction over speed, direction and place does not hold, and what is lost with it."""
    missing = found.late()
    for e in found.effects:
        if not _acts(e):
            missing.setdefault(e.id, TEXT(f"acts_on.{next(hook for hook in _HOOKS if e.answers(hook))}"))
        elif not _steady(e):
            missing[e.id] = TEXT("in_time")
    if found.surface.dragged:
        missing["stick and slip of the wall"] = TEXT("saw")
    return missing


def _acts(effect: type[Effect]) -> bool:
    return any(effect.answers(hook) for hook in ("level", "shared", "force", "normal_load"))


def _steady(effect: type[Effect]) -> bool:
    """Whether what an effect adds to friction follows from speed, direction and position alone."""
    names = ("t", "travelled", "dwell", "tension", "drag", "drag_rate", "rate", "load")
    history = {name: ca.SX.sym(name) for name in names}
    owners = [effect, *([CATALOGUE[effect.of]] if effect.of else [])]
    p = {q.name: ca.SX.sym(q.name) for owner in owners for q in owner.parameters()}
    z = {name: ca.SX.sym(name) for name in effect.states}
    s = Signals(x=ca.SX.sym("x"), v=ca.SX.sym("v"), direction=ca.SX.sym("d"), command=0.0, **history)
    terms = [getattr(effect(), hook)(s, p, z) for hook in ("level", "force", "normal_load")]
    added = ca.vertcat(*(ca.SX(value) for value in terms))
    return not any(ca.depends_on(added, symbol) for symbol in (*history.values(), *z.values()))


def _law(found: Found, effects: tuple[type[Effect], ...]) -> Any:
    """Friction, mucus, other forces and the wall's limit (4, n) in N at (3, n) speed, direction, position."""
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
