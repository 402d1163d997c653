"""Records in; what the model lacks, and the better model, out: examine, prepare, search, predict, judge, answer."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from models.checks.examine import examine, stopping
from models.checks.excitation import cannot_show, inseparable
from models.checks.finding import RecordFinding
from models.identification import verdict
from models.identification.answer import answer
from models.identification.finding import STAGES, Check, Finding, Trace
from models.identification.intervals import intervals
from models.identification.kinds import NOTHING_KNOWN, Known, kind_for, ready
from models.identification.kinds.axis.axis import AxisKind
from models.identification.kinds.reports import AnyKind
from models.identification.kinds.series.series import SeriesKind
from models.identification.model import Model, own_effects_of
from models.identification.possible import choice_of
from models.identification.record_checks import check_parts, check_records
from models.identification.search.search import Search, search
from models.identification.settings import SET
from models.identification.smallest import smallest
from models.identification.steps import Choice, Judged, Predicted, Prepared
from models.identification.thinning import said_of, slower, thinned
from models.identification.validity import Ranges, ranges_of
from models.records.record import Record
from models.rigs.rig import Rig
from models.words.sentences import Quantity, Sentences
from models.workers import worker_count

TEXT: Final = Sentences(__file__)
_POINTS: Final = 8  # that a kind simulates at once
_BATCHES: Final = 1500.0  # of points, in the search of an effect
_TRIES: Final = 3  # of a timing: the shortest counts
_REST: Final = 8.0
"""With it searches in 1 and 12 records of an axis and in 3 pulls took 0.7 to 1.4 times the estimate."""


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
    search uses no more rows and records than it needs, and those that `budget_s` allows; records that it left out and
    does not explain join it, the worst ones first. Without a budget, the same records and `seed` give the same numbers.
    Raises ValueError for records from which nothing is identifiable.
    """
    began = time.monotonic()
    findings = examined(rig, train, holdout)
    logged, holdout = [ready(record, rig) for record in train], slower([ready(record, rig) for record in holdout])
    train, others = thinned(logged)
    prepared = prepare(rig, train, known, findings)
    check_parts(prepared.kind, train, [*holdout, *others])
    cut = (seconds := seconds_of_search(prepared.kind, train)) > budget_s
    if cut:
        train, others = thinned(logged, sum(map(len, train)) * budget_s / seconds)
        seconds = budget_s
    progress(TEXT("estimate", seconds=seconds, rows=sum(map(len, train)), workers=worker_count()), 0.01)
    if told is not None:
        told(smallest(prepared.kind, train))
    joined = list[Record]()
    for again in (True, False):
        found = search(prepared.kind, train, progress, np.random.default_rng(seed), most, began + budget_s)
        worse, outside = verdict.unexplained(prepared.kind, found, others)
        if not (worse and again) or found.ended == "time":
            break
        joined, train = [*joined, *worse], [*train, *worse]
        others = [record for record in others if record not in worse]
        prepared = prepare(rig, train, known, findings)
    progress("predicting and judging", 0.95)
    predicted = predict(prepared.kind, found, {"train": train, "holdout": holdout})
    judged = judge(prepared, found, train, holdout, predicted.error["holdout"], seed, outside)
    progress("planning the next experiment", 0.97)
    choice = choice_of(prepared, found, predicted, judged, train, seed)
    joining = TEXT("joined", records=[record.name for record in joined]) if joined else ""
    ended = TEXT("statement.ended_time") if found.ended == "time" else ""
    left_out = " ".join(filter(None, (said_of(logged, train, cut), joining, ended)))
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
    if isinstance(kind, SeriesKind | AxisKind):
        kind = replace(kind, equivalents=inseparable(rig, records, kind.effects))
    return kind, hidden


def seconds_of_search(kind: AnyKind, records: Sequence[Record]) -> float:
    """About how long the search for one effect takes in `records`, on the workers that there are: from the time of one
    simulation, and from the rows that all splits fit, and `_REST` times the records' own, which the rest of it fits.
    """
    searched, values, spent = kind.searched(records), [kind.nominal()] * _POINTS, list[float]()
    for _ in range(_TRIES):
        began = time.perf_counter()
        for record in searched:
            kind.predictions(record, values)
        spent.append(time.perf_counter() - began)
    fitted = sum(len(record) for part, _ in kind.splits(searched) for record in part)
    return _BATCHES * min(spent) * (max(fitted / sum(map(len, searched)), 1.0) + _REST) / worker_count()


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
    more: Sequence[Check] = (),
) -> Judged:
    """The verdict on what was `found`; `error` is that of the held-out records by stage, empty without any, and `more`
    are further checks. Without effects the last stage is the one before it; where it errs more than an earlier one, and
    beyond what right models leave, that weakens the verdict.
    """
    kind, fit, rng = prepared.kind, found.augmented, np.random.default_rng(seed)
    fitted = intervals(kind, fit, found.model, found.parts)
    rest, floor = verdict.checks_of_rest(kind, found, train, holdout, rng), kind.noise_floor(holdout or train)
    worse, last = verdict.setbacks(error, floor, kind.error_unit), "augmented" if found.effects else "calibrated"
    said = {stage: sentence for stage, sentence in worse.items() if found.effects or stage != "augmented"}
    bounds = {
        "calibrated": verdict.at_bounds(kind, found.calibrated, []),
        "augmented": verdict.at_bounds(kind, fit, found.effects, found.refinements),
    }
    beyond = any(check.id == "held_out" and not check.ok for check in rest)
    findings = (*verdict.setback_findings(said, holdout, bounds, last if beyond else None), *prepared.findings)
    periods = verdict.periods_of(kind, found.effects, fit.theta, train)
    open_ = verdict.unshown(kind, found.effects, fit.theta, train)
    fitted |= {
        name: replace(fitted[name], ci95=ends, identifiable=False) for name, ends in open_.items() if name in fitted
    }
    checks = (*rest, *more, *verdict.checks_of_model(kind, found, fitted, error, findings, periods))
    return Judged(verdict.verdict_of(found.effects, checks), checks, findings, fitted, floor, worse)


def _model(
    kind: AnyKind, predicted: Predicted, judged: Judged, provenance: dict[str, str], choice: Choice, validity: Ranges
) -> Model:
    held_out = {stage: float(error) for stage, error in predicted.error["holdout"].items() if np.isfinite(error)}
    own = own_effects_of({**predicted.thetas, **choice.possible}, kind.catalogue)
    more = (choice.barred, choice.refuted, choice.possible, choice.unexplained, validity)
    return Model(kind.name, predicted.thetas, judged.verdict, provenance, held_out, own, judged.worse, *more)
