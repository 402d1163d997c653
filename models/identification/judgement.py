"""What a search found, judged: the stages' predictions and errors, intervals, checks and the verdict."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.usable import lead_in_s
from models.identification.finding import STAGES, Check, Fitted, Trace
from models.identification.fitting.confidence import drawn, intervals
from models.identification.kinds.reports import AnyKind
from models.identification.preparation import Prepared
from models.identification.search.forward_selection import Search
from models.identification.settings import SET
from models.identification.verdict import (
    at_bounds,
    by_chance,
    chance_error,
    model_checks,
    residual_checks,
    setback_findings,
    setbacks,
    verdict_of,
)
from models.parameter import Name
from models.records.record import Record
from models.rigs.columns import TIME
from models.theta import Theta


@dataclass(frozen=True)
class Predicted:
    """The values of each stage of the model, the records as the stages predict them, and the reported errors."""

    thetas: dict[str, Theta]
    traces: tuple[Trace, ...]
    error: dict[str, dict[str, float]]

    @classmethod
    def of(cls, kind: AnyKind, found: Search, parts: Mapping[str, Sequence[Record]]) -> Predicted:
        """Of the `parts` of the data, each of which may be empty."""
        nominal = kind.nominal()
        values = [nominal, nominal | found.calibrated.theta, nominal | found.augmented.theta]
        traces, errors = list[Trace](), dict[str, dict[str, float]]()
        for part, records in parts.items():
            outputs = [dict(zip(STAGES, kind.predictions(record, values), strict=True)) for record in records]
            stages = STAGES if records else ()
            errors[part] = {stage: kind.error(records, [one[stage] for one in outputs]) for stage in stages}
            traces += [_trace(kind, record, part, one) for record, one in zip(records, outputs, strict=True)]
        return cls(dict(zip(STAGES, values, strict=True)), tuple(traces), errors)


def _trace(kind: AnyKind, record: Record, role: str, predicted: dict[str, np.ndarray]) -> Trace:
    axes = ("t_s", "frequency_Hz", "period_s")
    axis = next((name for name in axes if name in record.columns), next(iter(record.columns)))
    measured = np.asarray(kind.measured(record))
    return Trace(record.name, role, axis, record[axis], measured, predicted, kind.signals(record))


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

    @classmethod
    def of(cls, prepared: Prepared, found: Search, error: Mapping[str, float], seed: int) -> Judged:
        """`error` is that of the held-out records by stage; empty without any."""
        kind, train, holdout, fit = prepared.kind, prepared.train, prepared.holdout, found.augmented
        fitted = intervals(kind, fit, found.model, found.parts)
        rng = np.random.default_rng(seed)
        likely = _draws(kind, found, rng)
        near = _draws(kind, found, rng, [name for name, estimate in fitted.items() if estimate.identifiable])
        residuals = residual_checks(kind, train, fit, near, effects=found.effects)
        allowed = next((check.limit for check in residuals if check.id == "residual_size"), 0.0)
        chance, floor = chance_error(kind, holdout, fit, likely), kind.noise_floor(holdout or train)
        worse = setbacks(error, floor, kind.error_unit)
        findings = (*_setbacks(prepared, found, worse, error, chance), *prepared.findings)
        longest_s = max(_seconds(record) for record in train)
        checks = (*residuals, *model_checks(kind, found, fitted, error, findings, allowed, chance, longest_s))
        return cls(verdict_of(found.effects, checks), checks, findings, fitted, floor, worse)


def _draws(kind: AnyKind, found: Search, rng: np.random.Generator, only: Collection[Name] | None = None) -> list[Theta]:
    """Draws of the values of the last fit, or of `only` those named."""
    return [drawn(kind, found.augmented, found.model, rng, only) for _ in range(SET.draws)]


def _setbacks(
    prepared: Prepared, found: Search, worse: Mapping[str, str], error: Mapping[str, float], chance: float
) -> tuple[RecordFinding, ...]:
    """Findings on the stages that are `worse`; without effects the last stage is the one before it."""
    last = "augmented" if found.effects else "calibrated"
    said = {stage: sentence for stage, sentence in worse.items() if found.effects or stage != "augmented"}
    weakened = None if by_chance(error.get(last, np.nan), chance) else last
    bounds = at_bounds(prepared.kind, found.augmented, found.model)
    return setback_findings(said, prepared.holdout, bounds, weakened)


def _seconds(record: Record) -> float:
    """How long in s its residuals count; infinite for a table, whose rows have no time."""
    return float(np.ptp(record[TIME])) - lead_in_s(record) if record.layout.time else np.inf
