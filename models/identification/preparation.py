"""Records made ready for a search: checked, cleaned, with their kind and the candidates that they can show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from models.checks.examine import examine, stopping
from models.checks.excitation import cannot_show, inseparable
from models.checks.finding import RecordFinding
from models.effects.effect import Effect
from models.identification.kinds import Known, kind_for, ready
from models.identification.kinds.reports import AnyKind
from models.identification.kinds.series.series import SeriesKind
from models.identification.record_checks import check_parts, check_records
from models.records.record import Record
from models.rigs.rig import Rig
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)


@dataclass(frozen=True)
class Prepared:
    """The records of a `rig`, their `kind` with the candidates that they can show, the `declared` effects by id, why
    the records `cannot_show` some of them, and the `findings` on the records.
    """

    rig: Rig
    kind: AnyKind
    train: list[Record]
    holdout: list[Record]
    declared: Mapping[str, type[Effect]]
    cannot_show: dict[str, str]
    findings: tuple[RecordFinding, ...]

    @classmethod
    def of(cls, rig: Rig, train: Sequence[Record], holdout: Sequence[Record], known: Known) -> Prepared:
        """Raises ValueError for records from which nothing is identifiable."""
        findings = examine(rig, [*train, *holdout])
        stop = stopping(findings)
        if stop is not None:
            raise ValueError(TEXT("stopped", **stop.to_dict()))
        check_records(train, holdout)
        train, holdout = [ready(r, rig) for r in train], [ready(r, rig) for r in holdout]
        whole = kind_for(rig, train, known)
        kind, hidden = narrowed(whole, rig, train)
        check_parts(kind, train, holdout)
        declared = {**whole.catalogue, **{effect.id: effect for effect in whole.effects}}
        return cls(rig, kind, train, holdout, declared, hidden, findings)

    @property
    def hidden(self) -> list[type[Effect]]:
        """The effects that the records cannot show."""
        return [self.declared[name] for name in self.cannot_show]


def narrowed(kind: AnyKind, rig: Rig, records: Sequence[Record]) -> tuple[AnyKind, dict[str, str]]:
    """`kind` with the effects that `records` can show and the inseparable ones; why they cannot show others, by id."""
    hidden = cannot_show(rig, records, kind.effects)
    if hidden:
        kind = replace(kind, effects=tuple(effect for effect in kind.effects if effect.id not in hidden))
    if isinstance(kind, SeriesKind):
        kind = replace(kind, equivalents=inseparable(rig, records, kind.effects))
    return kind, hidden
