"""From a finished search to the answer: verdict, intervals, checks, errors before and after on held-out data."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from models.checks.examine import examine, stopping
from models.checks.excitation import cannot_show, inseparable, shown_with
from models.checks.finding import RecordFinding
from models.checks.usable import lead_in_s
from models.effects.equation import symbols_of
from models.identification.confidence_map import confidence_map
from models.identification.experiment.propose import propose, words_of
from models.identification.finding import STAGES, CandidateRow, Check, Finding, Fitted, FoundEffect, Trace
from models.identification.fitting.confidence import drawn, intervals
from models.identification.kinds import NOTHING_KNOWN, Known, kind_for, ready
from models.identification.kinds.reports import AnyKind, report_of
from models.identification.kinds.series.series import SeriesKind
from models.identification.model import Model, own_effects_of
from models.identification.record_checks import check_parts, check_records
from models.identification.residual.dependence import dependence_of
from models.identification.residual_tests import chance_error, residual_checks
from models.identification.search.forward_selection import Search, search
from models.identification.settings import SET
from models.identification.verdict import at_bounds, by_chance, model_checks, setback_findings, setbacks, verdict_of
from models.parameter import Name
from models.records.record import Record
from models.rigs.columns import TIME
from models.rigs.rig import Rig
from models.theta import Theta


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
    looked through for what makes it unusable, then not opened until the end.

    Base parameters that are `known` from elsewhere take the place of the rig file's and hold the calibration as its
    `[prior]` does; effects that are known belong to the base. At `most` so many effects are looked for. The same
    records and `seed` give the same numbers. Raises ValueError for records that cannot tell anything.
    """
    began = time.monotonic()
    findings = examine(rig, [*train, *holdout])
    stop = stopping(findings)
    if stop is not None:
        raise ValueError(f"{stop.file}, {stop.where}: {stop.sentence} Remedy: {stop.remedy}")
    check_records(train, holdout)
    train, holdout = [ready(r, rig) for r in train], [ready(r, rig) for r in holdout]
    kind = kind_for(rig, train, known)
    declared = {**kind.catalogue, **{effect.id: effect for effect in kind.effects}}
    kind, hidden = narrowed(kind, rig, train)
    words = report_of(kind)
    check_parts(kind, train, holdout)
    found = search(kind, train, progress, np.random.default_rng(seed), most)
    nominal, fit = kind.nominal(), found.augmented
    values = (nominal, nominal | found.calibrated.theta, nominal | fit.theta)
    thetas = dict(zip(STAGES, values, strict=True))
    progress("held-out records", 0.95)
    errors = {"train": _errors(kind, train, thetas), "holdout": _errors(kind, holdout, thetas)}
    held = errors["holdout"]
    spread = intervals(kind, fit, found.model, found.parts)
    rng = np.random.default_rng(seed)
    likely = [drawn(kind, fit, found.model, rng) for _ in range(SET.draws)]
    sure = [name for name, estimate in spread.items() if estimate.told]
    near = [drawn(kind, fit, found.model, rng, sure) for _ in range(SET.draws)]
    residuals = residual_checks(kind, train, fit, near, effects=found.effects)
    chance, floor = chance_error(kind, holdout, fit, likely), kind.noise_floor(holdout or train)
    worse = setbacks(held, floor)
    last = "augmented" if found.effects else "calibrated"
    said = {stage: words for stage, words in worse.items() if found.effects or stage != "augmented"}
    weakened = None if by_chance(held.get(last, np.nan), chance) else last
    findings = (*setback_findings(said, holdout, at_bounds(kind, fit, found.model), weakened), *findings)
    allowed = next((check.limit for check in residuals if check.id == "residual_size"), 0.0)
    longest_s = max(_seconds(record) for record in train)
    checks = (*residuals, *model_checks(kind, found, spread, held, findings, allowed, chance, longest_s))
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
    wanted = words.next_experiment(kind, thetas["augmented"], train)
    own = words.statements(kind, thetas, train)
    finding = Finding(
        kind=kind.name,
        quantity=kind.quantity,
        unit=kind.unit,
        measure=kind.measure,
        verdict=verdict,
        effects=tuple(_effect(kind, name, found, spread, verdict) for name in found.effects),
        calibration={name: estimate for name, estimate in spread.items() if isinstance(name, str)},
        nominal=dict(nominal.base),
        error=errors,
        noise_floor=floor,
        checks=checks,
        candidates=tuple(_rows(found)),
        smallest_detectable=found.detectable,
        next_experiment=_next(findings, verdict, (words_of(proposal), wanted)),
        statements=(*_statements(kind, found, verdict), *_proposed(kind, found, train, holdout), *own),
        equations=tuple(words.equations(kind, thetas["augmented"])),
        symbolic=tuple(words.equations(kind, symbols_of(thetas["augmented"], spread))),
        traces=(
            *(_trace(kind, r, "train", thetas) for r in train),
            *(_trace(kind, r, "holdout", thetas) for r in holdout),
        ),
        seconds=time.monotonic() - began,
        timings=found.timings,
        findings=findings,
        cannot_show=hidden,
        reasons=_reasons(verdict, checks, findings),
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
    """`kind` with what `records` can show and what no form tells apart; why they cannot show the others, by id."""
    hidden = cannot_show(rig, records, kind.effects)
    if hidden:
        kind = replace(kind, effects=tuple(effect for effect in kind.effects if effect.id not in hidden))
    if isinstance(kind, SeriesKind):
        kind = replace(kind, equivalents=inseparable(rig, records, kind.effects))
    return kind, hidden


def _seconds(record: Record) -> float:
    """How long its residuals count; not limited for a table, whose rows have no time."""
    return float(np.ptp(record[TIME])) - lead_in_s(record) if record.layout.time else np.inf


def _reasons(verdict: str, checks: Sequence[Check], findings: Sequence[RecordFinding]) -> tuple[str, ...]:
    """Why the verdict is `unknown`: what weakens the records, and the checks that fail."""
    if verdict != "unknown":
        return ()
    failed = [f"{c.name}: {c.value:.3g}, at most {c.limit:.3g} allowed ({c.meaning})" for c in checks if not c.ok]
    weak = dict.fromkeys(finding.sentence for finding in findings if finding.severity == "weakens")
    return (*weak, *failed)


def _next(findings: Sequence[RecordFinding], verdict: str, told: Sequence[str | None]) -> str | None:
    """What to record next: for `unknown`, what mends the records where they weaken it; then what else is `told`."""
    weak = [finding.remedy for finding in findings if finding.severity == "weakens" and verdict == "unknown"]
    return "; ".join(dict.fromkeys(words for words in (*weak, *told) if words)) or None


def _effect(kind: AnyKind, name: str, found: Search, spread: Mapping[Name, Fitted], verdict: str) -> FoundEffect:
    curves = {curve: _own(curve, spread) for curve in found.refinements if curve in kind.catalogue[name].refined_by}
    score = found.score[name] if verdict == "named" else min(found.score[name], SET.part_score)
    known, own = confidence_map(), _own(name, spread)
    sure = known.probability(score)
    told = (found.gains[name], sure, curves, score, known.calibrated, known.words(sure))
    return FoundEffect(name, found.equivalent[name], own, *told)


def _own(name: str, spread: Mapping[Name, Fitted]) -> dict[str, Fitted]:
    return {key[1]: value for key, value in spread.items() if not isinstance(key, str) and key[0] == name}


def _rows(found: Search) -> list[CandidateRow]:
    rows = []
    for number, screened, trials in found.rounds:
        gains = {trial.effect: trial.gain for trial in trials}
        added = found.effects[number - 1] if len(found.effects) >= number else ""
        for row in screened:
            note = "added" if row.effect == added else "fitted" if row.effect in gains else "screened only"
            if added and row.effect in found.equivalent[added]:
                note = f"not distinguishable from {added}"
            rows.append(CandidateRow(row.effect, number, row.share, gains.get(row.effect), note))
    return rows


def _statements(kind: AnyKind, found: Search, verdict: str) -> list[str]:
    said = [
        f"Validation cost for each residual: {found.before:.3g} calibrated, {found.after:.3g} with what was added; "
        f"the null distribution (parametric bootstrap) leaves {found.null_cost:.3g}."
    ]
    if found.effects:
        said.append(
            f"The effects take away {100 * min(found.explained, 1.0):.0f} % of the misfit beyond chance on records not"
            " used to fit them."
        )
    if found.horizon_s < np.inf:
        said.append(
            f"Predictability horizon: a 0.1 % change of the base parameters adds or removes slip events after"
            f" {found.horizon_s:g} s; effects are judged on the records up to there."
        )
    elif found.sensitivity > SET.clean * found.null_cost:
        said.append(
            "The motion is sensitive to parameters: a 0.1 % change of the base parameters adds or removes slip events"
            f" and alone leaves a validation cost of {found.sensitivity:.3g}; errors far below that are coincidence."
        )
    said += [
        f"{kind.catalogue[name].summary.capitalize()} ({name}) refines the shape of"
        f" {', '.join(e for e in found.effects if name in kind.catalogue[e].refined_by)}."
        for name in found.refinements
    ]
    if verdict == "unknown":
        said.append(
            "The residual is structured and no candidate explains it."
            if found.after >= SET.clean * found.null_cost
            else (
                "Fits leave as much of the model's own predictions: an effect that is smaller than that cannot be seen."
            )
        )
    return said


def _proposed(kind: AnyKind, found: Search, train: Sequence[Record], holdout: Sequence[Record]) -> list[str]:
    """Which records an effect was proposed on, where it was proposed from a residual, and what that means here."""
    said = []
    for name in found.effects:
        on = kind.catalogue[name].proposed_on
        again = [r.name for r in train if r.name in on]
        if not on:
            continue
        tested = [r.name for r in holdout if r.name not in on]
        said.append(
            f"The effect {name} was proposed on the residual of {', '.join(on)}; it was selected here on "
            + (f"the same ({', '.join(again)}), which favours it" if again else "other records")
            + (
                f"; {', '.join(tested)} had no part in the proposal and test it."
                if tested
                else "; nothing else tests it."
            )
        )
    return said


def _trace(kind: AnyKind, record: Record, role: str, thetas: Mapping[str, Theta]) -> Trace:
    measured = np.asarray(kind.measured(record))
    predicted = {stage: np.asarray(kind.predict(record, thetas[stage])) for stage in STAGES}
    signals = kind.signals(record)
    axis = next(
        (name for name in ("t_s", "frequency_Hz", "period_s") if name in record.columns), next(iter(record.columns))
    )
    return Trace(record.name, role, axis, record[axis], measured, predicted, signals)
