"""The gate that a learned model passes before a controller may use it: better on held-out records, parameters within
bounds.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from controller.limits import number
from models.assembly.model import effect_parameters
from models.effects import Catalogue
from models.identification.finding import STAGES
from models.identification.kinds import kind_for
from models.identification.model import Model
from models.parameter import nearest
from models.rigs.rig import Rig
from models.theta import Theta, spelled


@dataclass(frozen=True)
class Acceptance:
    """Whether a model passed, and what spoke against it."""

    reasons: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """No reason speaks against it."""
        return not self.reasons

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        return "passed" if self.passed else "; ".join(self.reasons)


@dataclass(frozen=True)
class AcceptanceTest:
    """What a model must show: a held-out error at most `share` of the current model's on the same records."""

    share: float = 0.99

    def __post_init__(self) -> None:
        if not 0 < self.share <= 1:
            raise ValueError(f"share of the current model's error must lie in (0, 1]; got {self.share!r}")

    def judge(
        self,
        report: Mapping[str, Any],
        model: Model,
        rig: Rig,
        *,
        stage: str = "augmented",
        current: str | float = "calibrated",
    ) -> Acceptance:
        """Judge `stage` of a `model` that close-loop wrote with its `report` (the object of report.json) for `rig`.

        `current` is the stage in use, or the held-out error of the model in use on the same records. A report or a
        model that cannot be read does not pass. Raises ValueError for an unknown stage.
        """
        for name in (stage, current):
            if isinstance(name, str) and name not in STAGES:
                raise ValueError(f"stage must be one of {', '.join(STAGES)}; got {name!r}; {nearest(name, STAGES)}")
        return Acceptance(
            (
                *_kind(report, model, rig),
                *_one(report, model, stage),
                *self._error(report, stage, current),
                *_bounds(model, rig, stage),
            )
        )

    def _error(self, report: Mapping[str, Any], stage: str, current: str | float) -> tuple[str, ...]:
        held = _held_out(report)
        if not _is_error(held.get(stage)):
            return (f"held-out error of the {stage} model must be in the report; it is missing",)
        new, old = number(held[stage]), number(held.get(current)) if isinstance(current, str) else number(current)
        if not _is_error(old):
            return ("held-out error of the current model must be known on the same records; it is missing",)
        if not new <= self.share * old:
            return (f"held-out error must be at most {self.share:g} of the current model's {old:.4g}; got {new:.4g}",)
        return ()


def _held_out(report: Mapping[str, Any]) -> Mapping[str, Any]:
    error = report.get("error")
    held = error.get("holdout") if isinstance(error, Mapping) else None
    return held if isinstance(held, Mapping) else {}


def _one(report: Mapping[str, Any], model: Model, stage: str) -> tuple[str, ...]:
    """Whether the report is the model's own."""
    own, told = model.held_out.get(stage), number(_held_out(report).get(stage))
    if own is not None and math.isfinite(told) and not math.isclose(own, told, rel_tol=1e-9):
        return (f"report must be the one of the model, whose held-out error is {own:.4g}; got {told:.4g}",)
    return ()


def _is_error(value: object) -> bool:
    return 0 <= number(value) < math.inf


def _kind(report: Mapping[str, Any], model: Model, rig: Rig) -> tuple[str, ...]:
    wrong = {model.kind, report.get("kind", model.kind)} - {rig.kind}
    return tuple(f"model must be one of a {rig.kind} rig; got one of a {kind} rig" for kind in sorted(map(str, wrong)))


def _bounds(model: Model, rig: Rig, stage: str) -> tuple[str, ...]:
    values = model.stages.get(stage, Theta())
    catalogue = Catalogue.of(rig)
    effects = tuple(catalogue[name] for name in values.effects if name in catalogue)
    declared = {p.key: p for p in (*kind_for(rig, []).base, *effect_parameters(effects))}
    unknown = tuple(
        f"parameter must be one of the model's; got {spelled(name)!r}" for name in values if name not in declared
    )
    return unknown + tuple(
        f"{spelled(name)} must lie in [{p.lower:g}, {p.upper:g}]; got {values[name]:g}"
        for name, p in declared.items()
        if name in values and not p.holds(values[name])
    )
