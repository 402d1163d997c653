"""A found model for export: its assembly, the values of a stage, and what of it no export can carry."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from hil.app.scenario.rig_file import read_deployed_rig
from models.assembly.model import Assembly, assemble
from models.drives.drive import Drive
from models.effects import CATALOGUE, Catalogue
from models.effects.effect import Effect
from models.files.toml import check_word
from models.identification.finding import STAGES
from models.identification.kinds import kind_for
from models.identification.kinds.series.drive_input import OF_THE_LOG
from models.identification.model import Model, read_model
from models.identification.validity import Ranges
from models.parameter import nearest
from models.rigs.kinds import KINDS, drive_of, freely, surface_of
from models.rigs.rig import Rig
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
        return logged | {e.id: TEXT("late") for e in self.effects if e.answers("delay")}


def read_found(rig: Path, model: Path, stage: str, driven: str = "", catalogue: Catalogue = CATALOGUE) -> Found:
    """A model that close-loop wrote with its rig; `driven` is the command where not the usual. Raises ValueError."""
    check_word(stage, "--stage", STAGES)
    belief = catalogue.given_to(read_deployed_rig(rig))
    if not KINDS[freely(belief).kind].of_capsule:
        able = ", ".join(name for name, kind in KINDS.items() if KINDS[freely(Rig(name)).kind].of_capsule)
        raise ValueError(f"{rig}: rig.kind must be one of {able} to be exported; got {belief.kind!r}")
    learned = read_model(model, belief.kind, catalogue=catalogue)
    values = learned.stages[stage]
    belief = freely(belief, turns=TURN.names[0] in values)
    known = kind_for(belief, []).catalogue
    effects = tuple(known[name] for name in sorted(values.effects))
    found = Found(belief, surface_of(belief), drive_of(belief, driven), effects, values, stage, learned.validity)
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
    for p in assembly.parameters:
        name, value = spelled(p.key), found.values.get(p.key)
        if value is None and p.fit:
            raise ValueError(f"{path}: model [{found.stage}] must have the key {name!r}; it is missing")
        if value is not None and not p.holds(value):
            raise ValueError(
                f"{path}: model [{found.stage}] {name} must lie in [{p.lower:g}, {p.upper:g}] {p.unit}; got {value:g}"
            )
