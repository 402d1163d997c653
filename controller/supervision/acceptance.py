"""The acceptance test of a learned model: better on held-out records, parameters within bounds."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from controller.limits import number
from models.assembly.model import effect_parameters
from models.effects import Catalogue
from models.files.toml import check_word
from models.identification.finding import STAGES
from models.identification.kinds import kind_for
from models.identification.model import Model
from models.rigs.kinds import drive_of, driven_by
from models.rigs.rig import Rig
from models.theta import Theta, spelled

BETTER: Final = 0.99  # greatest held-out error of a new model as a share of the current model's


@dataclass(frozen=True)
class Acceptance:
    reasons: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        return not self.reasons

    @property
    def sentence(self) -> str:
        return "passed" if self.passed else "; ".join(self.reasons)


def judge(
    report: Mapping[str, Any],
    model: Model,
    rig: Rig,
    *,
    stage: str = "augmented",
    current: str | float = "calibrated",
    share: float = BETTER,
) -> Acceptance:
    """Judge `stage` of a `model` from close-loop with its `report` (the object of report.json) for `rig`: its held-out
    error must be at most `share` of the current model's on the same records. `current` is the stage in use, or the
    held-out error of the model in use. An unreadable report or model does not pass. Raises ValueError for an unknown
    stage.
    """
    for name in (stage, current):
        if isinstance(name, str):
            check_word(name, "stage", STAGES)
    error = report.get("error")
    held = error.get("holdout") if isinstance(error, Mapping) else None
    held = held if isinstance(held, Mapping) else {}
    new, own = number(held.get(stage)), model.held_out.get(stage)
    old = number(held.get(current)) if isinstance(current, str) else number(current)
    wrong = sorted(map(str, {model.kind, report.get("kind", model.kind)} - {rig.kind}))
    reasons = [f"model must be one of a {rig.kind} rig; got one of a {kind} rig" for kind in wrong]
    if own is not None and math.isfinite(new) and not math.isclose(own, new, rel_tol=1e-9):
        reasons.append(f"report must be the one of the model, whose held-out error is {own:.4g}; got {new:.4g}")
    if not 0 <= new < math.inf:
        reasons.append(f"held-out error of the {stage} model must be in the report; it is missing")
    elif not 0 <= old < math.inf:
        reasons.append("held-out error of the current model must be known on the same records; it is missing")
    elif not new <= share * old:
        reasons.append(f"held-out error must be at most {share:g} of the current model's {old:.4g}; got {new:.4g}")
    barred = [f"the {stage} model must not lead as it is: {model.barred[stage]}"] if stage in model.barred else []
    return Acceptance((*reasons, *barred, *_bounds(model, rig, stage)))


def _bounds(model: Model, rig: Rig, stage: str) -> tuple[str, ...]:
    values = model.stages.get(stage, Theta())
    catalogue = Catalogue.of(rig)
    effects = tuple(catalogue[name] for name in values.effects if name in catalogue)
    driven = driven_by(values)
    drive = drive_of(rig, driven).parameters() if driven else ()
    declared = {p.key: p for p in (*kind_for(rig, []).base, *drive, *effect_parameters(effects))}
    unknown = tuple(
        f"parameter must be one of the model's; got {spelled(name)!r}" for name in values if name not in declared
    )
    return unknown + tuple(
        f"{spelled(name)} must lie in [{p.lower:g}, {p.upper:g}]; got {values[name]:g}"
        for name, p in declared.items()
        if name in values and not p.holds(values[name])
    )
