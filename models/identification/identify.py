"""Records in; what the model lacks, and the better model, out: examine, prepare, search, predict, judge, answer."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from models.checks.examine import examine, stopping
from models.checks.excitation import cannot_show, inseparable
from models.checks.finding import RecordFinding
from models.checks.usable import lead_in_s
from models.identification.answer import answer
from models.identification.effort import seconds_of_search
from models.identification.finding import STAGES, Finding, Trace
from models.identification.fitting.confidence import intervals
from models.identification.kinds import NOTHING_KNOWN, Known, kind_for, ready
from models.identification.kinds.reports import AnyKind
from models.identification.kinds.series.series import SeriesKind
from models.identification.model import Model, own_effects_of
from models.identification.possible import choice_of
from models.identification.record_checks import check_parts, check_records
from models.identification.search.screening import null_distribution, records_for_null
from models.identification.search.search import Search, search
from models.identification.settings import SET
from models.identification.steps import Choice, Judged, Predicted, Prepared
from models.identification.validity import Ranges, ranges_of
from models.identification.verdict import (
    at_bounds,
    checks_of_model,
    checks_of_rest,
    setback_findings,
    setbacks,
    verdict_of,
)
from models.records.record import Record
from models.records.thinning import slower, thinned
from models.rigs.columns import TIME
from models.rigs.rig import Rig
from models.words.quantities import measured_unit
from models.words.sentences import Quantity, Sentences
from models.workers import worker_count

TEXT: Final = Sentences(__file__)


def close(
    rig: Rig,
    train: Sequence[Record],
    holdout: Sequence[Record],
    progress: Callable[[str, float], None],
    seed: int = 0,
    known: Known = NOTHING_KNOWN,
    most: int = SET.most_effects,
    told: Callable[[Mapping[str, Quantity]], None] | None = None,
    drawn: bool = True,
    budget_s: float = np.inf,
) -> tuple[Finding, Model]:
    """Calibrate the rig's model on `train`, find what it lacks, and report the errors before and after; `holdout` is
    only checked for what makes it unusable until the end.

    Base parameters that are `known` from elsewhere replace the rig file's and constrain the calibration as its
    `[prior]` does; known effects belong to the base. At most `most` effects are searched for. Before the fit `told`, if
    given, gets the `smallest` sizes that would show. What a report alone shows is left out where none is `drawn`. A
    search uses no more rows than it needs, and those that `budget_s` allows. Without one, the same records and `seed`
    give the same numbers. Raises ValueError for records from which nothing is identifiable.
    """
    began = time.monotonic()
    findings = examined(rig, train, holdout)
    train, holdout = [ready(record, rig) for record in train], [ready(record, rig) for record in holdout]
    logged, (train, left_out), holdout = train, thinned(train), slower(holdout)
    prepared = prepare(rig, train, known, findings)
    check_parts(prepared.kind, train, holdout)
    if (seconds := seconds_of_search(prepared.kind, train)) > budget_s:
        train, left_out = thinned(logged, sum(map(len, train)) * budget_s / seconds)
        seconds = budget_s
    progress(TEXT("estimate", seconds=seconds, rows=sum(map(len, train)), workers=worker_count()), 0.01)
    if told is not None:
        told(smallest(prepared.kind, train))
    found = search(prepared.kind, train, progress, np.random.default_rng(seed), most, began + budget_s)
    progress("predicting and judging", 0.95)
    predicted = predict(prepared.kind, found, {"train": train, "holdout": holdout})
    judged = judge(prepared, found, train, holdout, predicted.error["holdout"], seed)
    progress("planning the next experiment", 0.97)
    choice = choice_of(prepared, found, predicted, judged, train, seed)
    finding = answer(prepared, found, predicted, judged, train, seed, choice, drawn, left_out)
    provenance = {"records": ", ".join(r.name for r in train), "seed": str(seed)}
    model = _model(prepared.kind, predicted, judged, provenance, choice, ranges_of(prepared.kind, train))
    progress("done", 1.0)
    return replace(finding, seconds=time.monotonic() - began), model


def examined(rig: Rig, train: Sequence[Record], holdout: Sequence[Record]) -> tuple[RecordFinding, ...]:
    """The findings on the records. Raises ValueError for records from which nothing is identifiable."""
    findings = examine(rig, [*train, *holdout])
    stop = stopping(findings)
    if stop is not None:
        raise ValueError(TEXT("stopped", **stop.to_dict()))
    check_records(train, holdout)
    return findings


def prepare(rig: Rig, train: Sequence[Record], known: Known, findings: tuple[RecordFinding, ...]) -> Prepared:
    """For training records that are `ready`."""
    kind = kind_for(rig, train, known)
    declared = {**kind.catalogue, **{effect.id: effect for effect in kind.effects}}
    kind, hidden = narrowed(kind, rig, train)
    return Prepared(rig, kind, declared, hidden, findings)


def narrowed(kind: AnyKind, rig: Rig, records: Sequence[Record]) -> tuple[AnyKind, dict[str, str]]:
    """`kind` with the effects that `records` can show and the inseparable ones; why they cannot show others, by id."""
    hidden = cannot_show(rig, records, kind.effects)
    if hidden:
        kind = replace(kind, effects=tuple(effect for effect in kind.effects if effect.id not in hidden))
    if isinstance(kind, SeriesKind):
        kind = replace(kind, equivalents=inseparable(rig, records, kind.effects))
    return kind, hidden


def smallest(kind: AnyKind, records: Sequence[Record]) -> dict[str, Quantity]:
    """The smallest amplitude of each effect of `kind` that a search in such `records` would tell from chance, before
    any fit: in records that the nominal model makes. Nothing where they are too few for that.
    """
    part = records_for_null(kind, kind.searched(records))
    _, sizes, _ = null_distribution(kind, part, kind.nominal(), np.random.default_rng(0))
    units = {name: kind.declared(name).amplitude().unit for name in sizes}
    return {name: Quantity(size, measured_unit(units[name], kind.unit)) for name, size in sorted(sizes.items())}


def predict(kind: AnyKind, found: Search, parts: Mapping[str, Sequence[Record]]) -> Predicted:
    """The `parts` of the data, each of which may be empty, at the stages of what was `found`."""
    nominal = kind.nominal()
    values = [nominal, nominal | found.calibrated.theta, nominal | found.augmented.theta]
    kinds = [kind.alone(column) for column in kind.channels]
    traces, errors = list[Trace](), [dict[str, dict[str, float]]() for _ in kinds]
    constant = dict[str, float]()
    for part, records in parts.items():
        outputs = [[one.predictions(record, values) for one in kinds] for record in records]
        for k, (one, error) in enumerate(zip(kinds, errors, strict=True)):
            column = kind.channels[k]
            logged = [(r, own[k]) for r, own in zip(records, outputs, strict=True) if not k or column in r.columns]
            rows = zip(STAGES, *(own for _, own in logged), strict=True) if logged else ()
            error[part] = {stage: one.error([r for r, _ in logged], own) for stage, *own in rows}
        if records and records[0].layout.time:
            levels = [np.full(len(record), np.mean(record[kind.quantity])) for record in records]
            constant[part] = kinds[0].error(records, levels)
        traces += [_trace(kinds, record, part, own) for record, own in zip(records, outputs, strict=True)]
    first, *further = errors
    beside = dict(zip(kind.channels[1:], further, strict=True))
    return Predicted(dict(zip(STAGES, values, strict=True)), tuple(traces), first, beside, constant)


def _trace(kinds: Sequence[AnyKind], record: Record, role: str, outputs: Sequence[Sequence[np.ndarray]]) -> Trace:
    kind, *further = kinds
    axes = ("t_s", "frequency_Hz", "period_s")
    axis = next((name for name in axes if name in record.columns), next(iter(record.columns)))
    measured, stages = np.asarray(kind.measured(record)), [*zip(*outputs, strict=True)]
    if further:
        none = np.full(len(record), np.nan)
        measured = np.column_stack([measured, *(record.columns.get(one.quantity, none) for one in further)])
        stages = [[np.column_stack(columns)] for columns in stages]
    predicted = {stage: own[0] for stage, own in zip(STAGES, stages, strict=True)}
    return Trace(record.name, role, axis, record[axis], measured, predicted, kind.signals(record), record.treated or ())


def judge(
    prepared: Prepared,
    found: Search,
    train: Sequence[Record],
    holdout: Sequence[Record],
    error: Mapping[str, float],
    seed: int,
) -> Judged:
    """The verdict on what was `found`; `error` is that of the held-out records by stage, empty without any. Without
    effects the last stage is the one before it; where it errs more than an earlier one, and beyond what right models
    leave, that weakens the verdict.
    """
    kind, fit, rng = prepared.kind, found.augmented, np.random.default_rng(seed)
    fitted = intervals(kind, fit, found.model, found.parts)
    rest, floor = checks_of_rest(kind, found, train, holdout, rng), kind.noise_floor(holdout or train)
    worse, last = setbacks(error, floor, kind.error_unit), "augmented" if found.effects else "calibrated"
    said = {stage: sentence for stage, sentence in worse.items() if found.effects or stage != "augmented"}
    bounds = {"calibrated": at_bounds(kind, found.calibrated, []), "augmented": at_bounds(kind, fit, found.model)}
    beyond = any(check.id == "held_out" and not check.ok for check in rest)
    findings = (*setback_findings(said, holdout, bounds, last if beyond else None), *prepared.findings)
    longest_s = max(
        float(np.ptp(r[TIME])) - lead_in_s(r) if r.layout.time else np.inf for r in train
    )  # tables: endless
    checks = (*rest, *checks_of_model(kind, found, fitted, error, findings, longest_s))
    return Judged(verdict_of(found.effects, checks), checks, findings, fitted, floor, worse)


def _model(
    kind: AnyKind, predicted: Predicted, judged: Judged, provenance: dict[str, str], choice: Choice, validity: Ranges
) -> Model:
    held_out = {stage: float(error) for stage, error in predicted.error["holdout"].items() if np.isfinite(error)}
    own = own_effects_of({**predicted.thetas, **choice.possible}, kind.catalogue)
    more = (choice.barred, choice.refuted, choice.possible, choice.unexplained, validity)
    return Model(kind.name, predicted.thetas, judged.verdict, provenance, held_out, own, judged.worse, *more)
