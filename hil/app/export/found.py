"""A found model for export: its assembly, the values of a stage, its friction, and what of it no export can carry."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from hil.app.scenario.rig_file import read_deployed_rig
from models.assembly.effects import Active
from models.assembly.model import Assembly, assemble
from models.assembly.step import Stepper
from models.drives.axis_force import AxisForce
from models.drives.drive import Drive
from models.effects import CATALOGUE, Catalogue
from models.effects.effect import Effect, Signals
from models.files.toml import check_word
from models.identification.finding import STAGES
from models.identification.kinds import kind_for
from models.identification.kinds.series.drive_input import OF_THE_LOG
from models.identification.model import Model, of_any_size, read_model
from models.identification.validity import Ranges
from models.parameter import nearest
from models.rigs.kinds import KINDS, drive_of, driven_by, freely, surface_of
from models.rigs.rig import Rig
from models.surfaces.gut import Drag
from models.surfaces.surface import TURN, Surface
from models.theta import Theta, spelled
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)


@dataclass(frozen=True)
class Found:
    """A model's parts at one stage: `values` by parameter name; the ranges that its records `covered`."""

    rig: Rig
    surface: Surface
    drive: Drive
    effects: tuple[type[Effect], ...]
    values: Theta
    stage: str
    covered: Ranges = field(default_factory=dict)

    def assembled(self) -> Assembly:
        return assemble(self.surface, self.drive, self.effects)

    @property
    def numbers(self) -> Theta:
        """Every parameter of surface, drive and effects, declared values where the stage has none."""
        return Theta.of((p.key, float(self.values.get(p.key, p.value))) for p in self.assembled().parameters)

    def late(self) -> dict[str, str]:
        """Delays of the measurement, which the step does not have: name and why."""
        logged = {name: TEXT("logged") for name in OF_THE_LOG if self.values.get(name)}
        loaded = {e.id: TEXT("no_load") for e in self.effects if e.loaded()}
        return logged | loaded | {e.id: TEXT("late") for e in self.effects if e.answers("delay")}


def read_found(rig: Path, model: Path, stage: str, driven: str = "", catalogue: Catalogue = CATALOGUE) -> Found:
    """A model that close-loop wrote with its rig; `driven` is the command where not the usual. Raises ValueError."""
    check_word(stage, "--stage", STAGES)
    belief = catalogue.given_to(read_deployed_rig(rig))
    if not KINDS[freely(belief).kind].of_capsule:
        able = ", ".join(name for name, kind in KINDS.items() if KINDS[freely(Rig(name)).kind].of_capsule)
        raise ValueError(f"{rig}: rig.kind must be one of {able} to be exported; got {belief.kind!r}")
    learned = read_model(model, belief.kind, catalogue=catalogue)
    values = learned.stages[stage]
    commanded = bool(belief.driven)
    belief = freely(belief, turns=TURN.names[0] in values)
    known = kind_for(belief, []).catalogue
    effects = tuple(known[name] for name in sorted(values.effects))
    drive = drive_of(belief, driven or driven_by(values))
    if isinstance(drive, AxisForce) and not commanded:
        drive = replace(drive, holds=False)
    found = Found(belief, surface_of(belief), drive, effects, values, stage, learned.validity)
    _check(found, learned, model)
    return found


def _check(found: Found, learned: Model, path: Path) -> None:
    """Refuse a model of another rig: one with names that this rig does not have, or without those that it has."""
    assembly = found.assembled()
    known = {spelled(p.key) for p in assembly.parameters} | set(OF_THE_LOG)
    strange = next((name for name in found.values.spelled() if name not in known), None)
    if strange is not None:
        raise ValueError(
            f"{path}: model [{found.stage}] must have parameters of its rig and effects; got {strange!r};"
            f" {nearest(strange, sorted(known))}"
        )
    for p in of_any_size(assembly.parameters) if isinstance(found.drive, AxisForce) else assembly.parameters:
        name, value = spelled(p.key), found.values.get(p.key)
        if value is None and p.fit:
            raise ValueError(f"{path}: model [{found.stage}] must have the key {name!r}; it is missing")
        if value is not None and not p.holds(value):
            raise ValueError(
                f"{path}: model [{found.stage}] {name} must lie in [{p.lower:g}, {p.upper:g}] {p.unit}; got {value:g}"
            )


Array = NDArray[np.float64]
SPEEDS_M_S: Final = (2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2)  # at which friction is tabled
PLACES_M: Final = tuple(np.round(np.linspace(-0.02, 0.08, 101), 6).tolist())
_HOOKS: Final = (
    "command", "response", "gain", "measured", "delay", "suspension", "reach", "stiffening", "wall_force", "recovery",
)  # fmt: skip
"""By which an effect acts on something else than friction."""


def friction_table(found: Found) -> dict[str, Array]:
    """The model's friction at `SPEEDS_M_S`, both directions and `PLACES_M`; SI, forces against the motion."""
    mapped = [e for e in found.effects if _steady(e) and _acts(e)]
    law = _law(found, tuple(mapped))
    grid = np.array([(v, d, x) for d in (1.0, -1.0) for v in SPEEDS_M_S for x in PLACES_M])
    friction, mucus, others, limit = np.array(law(grid.T))
    return {
        **dict(zip(("speed_m_s", "direction", "place_m"), grid.T, strict=True)),
        "friction_N": friction,
        "mucus_N": mucus,
        "others_N": others,
        "wall_limit_N": limit,
        "force_N": friction + others + 0.5 * limit,
        "peak_N": friction + others + limit,
    }


def tabled() -> dict[str, tuple[float, float]]:
    """The ranges of speed and place of such a table, by the names of signals."""
    return {"v_m_s": (-SPEEDS_M_S[-1], SPEEDS_M_S[-1]), "x_m": (PLACES_M[0], PLACES_M[-1])}


def not_mapped(found: Found) -> dict[str, str]:
    """The effects that a law of friction over speed, direction and place does not hold, and what is lost with it."""
    missing = found.late()
    for e in found.effects:
        if not _acts(e):
            hook = next((f"acts_on.{hook}" for hook in _HOOKS if e.answers(hook)), "in_time")
            missing.setdefault(e.id, TEXT(hook))
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
