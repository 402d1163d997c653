"""From a finished search to the result: verdict, intervals, checks, errors on training and held-out records."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from models.checks.examine import examine, stopping
from models.checks.excitation import cannot_show, inseparable, shown_with
from models.checks.finding import RecordFinding
from models.checks.usable import lead_in_s
from models.effects import effect_words
from models.effects.equation import symbols_of
from models.identification.confidence_map import confidence_map
from models.identification.experiment import propose, words_of
from models.identification.finding import STAGES, CandidateRow, Check, Finding, Fitted, FoundEffect, Trace
from models.identification.fitting.confidence import intervals
from models.identification.kinds import NOTHING_KNOWN, Known, kind_for, ready
from models.identification.kinds.reports import AnyKind, report_of
from models.identification.kinds.series.series import SeriesKind
from models.identification.model import Model, own_effects_of
from models.identification.record_checks import check_parts, check_records
from models.identification.residual_dependence import dependence_of
from models.identification.search.forward_selection import Search, search
from models.identification.settings import SET
from models.identification.verdict import (
    TEXT,
    at_bounds,
    checks_of_model,
    checks_of_rest,
    setback_findings,
    setbacks,
    verdict_of,
)
from models.parameter import Name
from models.records.record import Record
from models.rigs.columns import TIME
from models.rigs.rig import Rig
from models.theta import Theta
from models.words.sentences import sentence


def close(
    rig: Rig,
    train: Sequence[Record],
    holdout: Sequence[Record],
    progress: Callable[[str, float], None],
    seed: int = 0,
    known: Known = NOTHING_KNOWN,
    most: int = SET.most_effects,
) -> tuple[Finding, Model]:
    """Calibrate the rig's model on `train`, find what it lacks, and report the errors before and after; `holdout` is
    only checked for what makes it unusable until the end.

    Base parameters that are `known` from elsewhere replace the rig file's and constrain the calibration as its
    `[prior]` does; known effects belong to the base. At `most` so many effects are searched for. The same records and
    `seed` give the same numbers. Raises ValueError for records from which nothing is identifiable.
    """
    began = time.monotonic()
    findings = examine(rig, [*train, *holdout])
    stop = stopping(findings)
    if stop is not None:
        raise ValueError(TEXT("stopped", **stop.to_dict()))
    check_records(train, holdout)
    train, holdout = [ready(r, rig) for r in train], [ready(r, rig) for r in holdout]
    kind = kind_for(rig, train, known)
    declared = {**kind.catalogue, **{effect.id: effect for effect in kind.effects}}
    kind, hidden = narrowed(kind, rig, train)
    report, words = report_of(kind), partial(effect_words, catalogue=declared)
    check_parts(kind, train, holdout)
    found = search(kind, train, progress, np.random.default_rng(seed), most)
    nominal, fit = kind.nominal(), found.augmented
    values = (nominal, nominal | found.calibrated.theta, nominal | fit.theta)
    thetas = dict(zip(STAGES, values, strict=True))
    progress("held-out records", 0.95)
    errors = {"train": _errors(kind, train, thetas), "holdout": _errors(kind, holdout, thetas)}
    held = errors["holdout"]
    spread = intervals(kind, fit, found.model, found.parts)
    rest = checks_of_rest(kind, found, train, holdout, np.random.default_rng(seed))
    floor = kind.noise_floor(holdout or train)
    worse = setbacks(held, floor, kind.error_unit)
    last = "augmented" if found.effects else "calibrated"
    of_stages = {stage: said for stage, said in worse.items() if found.effects or stage != "augmented"}
    weakened = last if any(check.id == "held_out" and not check.ok for check in rest) else None
    findings = (*setback_findings(of_stages, holdout, at_bounds(kind, fit, found.model), weakened), *findings)
    longest_s = max(_seconds(record) for record in train)
    checks = (*rest, *checks_of_model(kind, found, spread, held, findings, longest_s))
    verdict = verdict_of(found.effects, checks)
    progress("the next experiment", 0.97)
    shown = shown_with(rig, train, [declared[name] for name in hidden]) if hidden else None
    proposal = propose(kind, kind.searched(train), found, shown, np.random.default_rng(seed))
    model = Model(
        kind.name,
        thetas,
        verdict,
        {"records": ", ".join(r.name for r in train), "seed": str(seed)},
        {stage: float(e) for stage, e in held.items() if np.isfinite(e)},
        own_effects_of(thetas, kind.catalogue),
        worse,
    )
    wanted = report.next_experiment(kind, thetas["augmented"], train)
    own = report.statements(kind, thetas, train)
    finding = Finding(
        kind=kind.name,
        quantity=kind.quantity,
        unit=kind.unit,
        measure=kind.measure,
        columns=kind.quantities,
        error_unit=kind.error_unit,
        verdict=verdict,
        effects=tuple(_effect(kind, name, found, spread, verdict) for name in found.effects),
        calibration={name: estimate for name, estimate in spread.items() if isinstance(name, str)},
        nominal=dict(nominal.base),
        error=errors,
        noise_floor=floor,
        checks=checks,
        candidates=tuple(_rows(found, words)),
        smallest_detectable=found.detectable,
        next_experiment=_next(findings, verdict, (words_of(proposal), wanted)),
        statements=(*_statements(kind, found, verdict, words), *_proposed(kind, found, train, holdout), *own),
        equations=tuple(report.equations(kind, thetas["augmented"])),
        symbolic=tuple(report.equations(kind, symbols_of(thetas["augmented"], spread))),
        traces=(
            *(_trace(kind, r, "train", thetas) for r in train),
            *(_trace(kind, r, "holdout", thetas) for r in holdout),
        ),
        seconds=time.monotonic() - began,
        timings=found.timings,
        findings=findings,
        cannot_show=hidden,
        reasons=_reasons(verdict, found.effects, checks, findings),
        proposal=proposal,
        dependence=dependence_of(kind, train, thetas["augmented"], seed) if verdict == "unknown" else None,
        declared=declared,
    )
    progress("done", 1.0)
    return finding, model


def _errors(kind: AnyKind, records: Sequence[Record], thetas: Mapping[str, Theta]) -> dict[str, float]:
    """The reported error of each stage; none without records."""
    if not records:
        return {}
    return {stage: kind.error(records, [kind.predict(r, theta) for r in records]) for stage, theta in thetas.items()}


def narrowed(kind: AnyKind, rig: Rig, records: Sequence[Record]) -> tuple[AnyKind, dict[str, str]]:
    """`kind` with the effects that `records` can show and the inseparable ones; why they cannot show others, by id."""
    hidden = cannot_show(rig, records, kind.effects)
    if hidden:
        kind = replace(kind, effects=tuple(effect for effect in kind.effects if effect.id not in hidden))
    if isinstance(kind, SeriesKind):
        kind = replace(kind, equivalents=inseparable(rig, records, kind.effects))
    return kind, hidden


def _seconds(record: Record) -> float:
    """How long in s its residuals count; infinite for a table, whose rows have no time."""
    return float(np.ptp(record[TIME])) - lead_in_s(record) if record.layout.time else np.inf


def _reasons(
    verdict: str, effects: Sequence[str], checks: Sequence[Check], findings: Sequence[RecordFinding]
) -> tuple[str, ...]:
    """Why the verdict is `unknown`: what weakens the records, and the checks that fail."""
    if verdict != "unknown":
        return ()
    last = "failed" if effects else "failed_of_none"
    failed = []
    for check in (check for check in checks if not check.ok):
        case = f"check.{check.id}.{last}"
        text = case if case in TEXT else f"check.{check.id}.failed"
        failed.append(TEXT(text, value=check.value, limit=check.limit, n=round(check.value)))
    return (*dict.fromkeys(finding.sentence for finding in findings if finding.severity == "weakens"), *failed)


def _next(findings: Sequence[RecordFinding], verdict: str, wanted: Sequence[str | None]) -> str | None:
    """What to record next: for `unknown`, what mends the records where they weaken it; then what else is `wanted`."""
    weak = [finding.remedy for finding in findings if finding.severity == "weakens" and verdict == "unknown"]
    return " ".join(dict.fromkeys(sentence(words) for words in (*weak, *wanted) if words)) or None


def _effect(kind: AnyKind, name: str, found: Search, spread: Mapping[Name, Fitted], verdict: str) -> FoundEffect:
    score = found.score[name] if verdict == "named" else min(found.score[name], SET.part_score)
    known = confidence_map()
    sure = known.probability(score)
    return FoundEffect(
        name,
        found.equivalent[name],
        _own(name, spread),
        found.gains[name],
        sure,
        {curve: _own(curve, spread) for curve in found.refinements if curve in kind.catalogue[name].refined_by},
        score,
        known.calibrated,
        known.words(sure),
    )


def _own(name: str, spread: Mapping[Name, Fitted]) -> dict[str, Fitted]:
    return {key[1]: value for key, value in spread.items() if not isinstance(key, str) and key[0] == name}


def _rows(found: Search, words: Callable[[str], str]) -> list[CandidateRow]:
    rows = []
    for number, screened, trials in found.rounds:
        gains = {trial.effect: trial.gain for trial in trials}
        added = found.effects[number - 1] if len(found.effects) >= number else ""
        for row in screened:
            if added and row.effect in found.equivalent[added]:
                note = TEXT("candidate.equivalent", added=words(added))
            else:
                became = "added" if row.effect == added else "fitted" if row.effect in gains else "screened"
                note = TEXT(f"candidate.{became}")
            rows.append(CandidateRow(row.effect, number, row.share, gains.get(row.effect), note))
    return rows


def _statements(kind: AnyKind, found: Search, verdict: str, words: Callable[[str], str]) -> list[str]:
    costs = {"before": found.before, "after": found.after, "chance": found.null_cost}
    said = [TEXT("statement.costs" if found.effects else "statement.cost", **costs, names=map(words, found.effects))]
    if found.effects:
        said.append(TEXT("statement.explained", share=min(found.explained, 1.0)))
    if found.horizon_s < np.inf:
        said.append(TEXT("statement.horizon", horizon=found.horizon_s))
    elif found.sensitivity > SET.clean * found.null_cost:
        said.append(TEXT("statement.sensitive", cost=found.sensitivity))
    for name in found.refinements:
        shaped = [words(effect) for effect in found.effects if name in kind.catalogue[effect].refined_by]
        said.append(sentence(TEXT("statement.refined", words=words(name), effects=shaped)))
    if verdict == "unknown":
        structured = found.after >= SET.clean * found.null_cost
        said.append(TEXT("statement.structured" if structured else "statement.too_small"))
    return said


def _proposed(kind: AnyKind, found: Search, train: Sequence[Record], holdout: Sequence[Record]) -> list[str]:
    """On which records an effect was proposed, if from a residual, and what follows from it."""
    said = []
    for name in found.effects:
        on = kind.catalogue[name].proposed_on
        again = [r.name for r in train if r.name in on]
        tested = [r.name for r in holdout if r.name not in on]
        if on:
            said += [
                TEXT("statement.proposed", effect=name, records=on),
                TEXT("statement.favoured" if again else "statement.unfavoured", records=again),
                TEXT("statement.tested" if tested else "statement.untested", records=tested, n=len(tested)),
            ]
    return said


def _trace(kind: AnyKind, record: Record, role: str, thetas: Mapping[str, Theta]) -> Trace:
    measured = np.asarray(kind.measured(record))
    predicted = {stage: np.asarray(kind.predict(record, thetas[stage])) for stage in STAGES}
    signals = kind.signals(record)
    axis = next(
        (name for name in ("t_s", "frequency_Hz", "period_s") if name in record.columns), next(iter(record.columns))
    )
    return Trace(record.name, role, axis, record[axis], measured, predicted, signals)
