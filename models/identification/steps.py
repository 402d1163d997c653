"""What the steps of an identification hand on."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from models.checks.finding import RecordFinding
from models.effects.effect import Effect
from models.identification.finding import Check, Fitted, Trace
from models.identification.kinds.reports import AnyKind
from models.parameter import Name
from models.rigs.rig import Rig
from models.theta import Theta


@dataclass(frozen=True)
class Prepared:
    """The `kind` of a `rig` with the candidates that the training records can show, the `declared` effects by id, why
    the records `cannot_show` some of them, and the `findings` on the records.
    """

    rig: Rig
    kind: AnyKind
    declared: Mapping[str, type[Effect]]
    cannot_show: dict[str, str]
    findings: tuple[RecordFinding, ...]

    @property
    def hidden(self) -> list[type[Effect]]:
        """The effects that the records cannot show."""
        return [self.declared[name] for name in self.cannot_show]


@dataclass(frozen=True)
class Predicted:
    """The values of each stage of the model, the records as the stages predict them, and the reported errors; those of
    each further measured column are `beside` them, and `constant` is that of the best constant by part.
    """

    thetas: dict[str, Theta]
    traces: tuple[Trace, ...]
    error: dict[str, dict[str, float]]
    beside: dict[str, dict[str, dict[str, float]]] = field(default_factory=dict)
    constant: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Judged:
    """The verdict with its `checks`, the `findings` on records and held-out errors, the fitted parameters with their
    intervals, the noise floor of the errors, and a sentence for each stage that is `worse` than one before it.
    """

    verdict: str
    checks: tuple[Check, ...]
    findings: tuple[RecordFinding, ...]
    fitted: dict[Name, Fitted]
    floor: float
    worse: dict[str, str]


@dataclass(frozen=True)
class Choice:
    """What a controller may choose from beside the stages of a model: the `possible` models by name, why a stage is
    `barred` from leading, why the records have `refuted` one, and the force that each leaves `unexplained`.
    """

    possible: Mapping[str, Theta] = field(default_factory=dict)
    barred: Mapping[str, str] = field(default_factory=dict)
    refuted: Mapping[str, str] = field(default_factory=dict)
    unexplained: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
