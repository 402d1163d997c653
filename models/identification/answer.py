"""The finding that a report shows, of a search that is judged: what was found, what was said of it, what comes next."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from models.checks.excitation import shown_with
from models.checks.finding import RecordFinding
from models.effects import effect_words
from models.effects.equation import symbols_of
from models.identification.confidence_map import confidence_map
from models.identification.disagreement import disagreements
from models.identification.experiment import propose, words_of
from models.identification.finding import (
    STAGES,
    CandidateRow,
    Check,
    Column,
    Finding,
    Fitted,
    FoundEffect,
)
from models.identification.inner_spline import followed_inside
from models.identification.kinds.reports import AnyKind, report_of
from models.identification.profile import profiles
from models.identification.residual_dependence import dependence_of
from models.identification.search.search import Search, limit_of_chance
from models.identification.settings import SET
from models.identification.smallest import least_sizes, not_missed, unshown
from models.identification.steps import Choice, Judged, Predicted, Prepared
from models.parameter import Name
from models.records.record import Record
from models.words.sentences import Sentences, sentence

TEXT: Final = Sentences(__file__)
STOPPED: Final = {
    "chance": "noise",
    "cost": "no gain",
    "form": "no gain",
    "gain": "no gain",
    "most": "four effects",
    "time": "time",
}
"""What a report says of why a search ended (`Search.ended`; "cost" is "chance" where the residual is more)."""
_OF_RESIDUAL: Final = ("residual_size", "whiteness", "held_out")  # checks


def answer(
    prepared: Prepared,
    found: Search,
    predicted: Predicted,
    judged: Judged,
    train: Sequence[Record],
    seed: int,
    choice: Choice,
    drawn: bool = True,
    left_out: str = "",
) -> Finding:
    """All that is known of the records and the model, but for how long it took; `left_out` says what of the records a
    search did without. What a report alone shows is missing where none is `drawn`.
    """
    kind, verdict, theta = prepared.kind, judged.verdict, predicted.thetas["augmented"]
    report, words = report_of(kind), partial(effect_words, catalogue=prepared.declared)
    left = any(not check.ok and check.id.partition(".")[0] in _OF_RESIDUAL for check in judged.checks)
    ended = "cost" if found.ended == "chance" and left else found.ended
    unexplained, hidden, rng = verdict == "unknown", prepared.hidden, np.random.default_rng(seed)
    records, base = kind.searched(train), kind.nominal() | found.calibrated.theta
    chance = found.threshold, found.null_cost
    sizes = not_missed(kind, least_sizes(kind, records, base, *chance), found) if drawn else {}
    much = unshown(kind, sizes) if sizes and verdict == "none" else []

    def shows_less(motion: Record) -> frozenset[str]:
        """Effects of which only `much` would have shown."""
        one = replace(kind, effects=tuple(much))
        left = unshown(one, least_sizes(one, [*records, kind.made(motion, base)], base, *chance))
        return frozenset(effect.id for effect in much if effect not in left)

    shown = shown_with(prepared.rig, train, hidden) if hidden or much or unexplained else None
    proposal = propose(kind, records, found, shown, rng, shows_less if much else None, unexplained=unexplained)
    dependence = dependence_of(kind, train, theta, seed) if drawn and unexplained else None
    wanted = (words_of(proposal), report.next_experiment(kind, theta, train, found.equivalent))
    return Finding(
        kind=kind.name,
        quantity=kind.quantity,
        unit=kind.unit,
        measure=kind.measure,
        columns=kind.quantities,
        error_unit=kind.error_unit,
        verdict=verdict,
        effects=tuple(_effect(kind, name, found, judged.fitted, verdict) for name in found.effects),
        calibration={name: estimate for name, estimate in judged.fitted.items() if isinstance(name, str)},
        nominal=dict(predicted.thetas["nominal"].base),
        error=predicted.error,
        beside=_beside(kind, predicted, train),
        noise_floor=judged.floor,
        checks=judged.checks,
        candidates=tuple(candidate_rows(found, words)),
        smallest_detectable=sizes,
        next_experiment=_next(judged.findings, verdict, wanted),
        statements=(
            *([left_out] if left_out else []),
            *_statements(kind, found, predicted, words, ended),
            *_proposed(kind, found, predicted),
            *report.statements(kind, predicted.thetas, train),
        ),
        equations=tuple(report.equations(kind, theta)),
        symbolic=tuple(report.equations(kind, symbols_of(theta, judged.fitted))),
        traces=predicted.traces,
        seconds=float("nan"),
        timings=found.timings,
        findings=judged.findings,
        cannot_show={**prepared.cannot_show, **without_size(kind, sizes)},
        reasons=_reasons(verdict, judged.checks, judged.findings),
        proposal=proposal,
        dependence=dependence and followed_inside(kind, found, train, dependence),
        declared=prepared.declared,
        leading=_leading(choice),
        disagreeing=disagreements(kind, found.augmented, found.model, train) if drawn else (),
        profiles=profiles(kind, found.augmented, found.model, train) if drawn else (),
        stopped=STOPPED[ended],
        constant=predicted.constant,
        left_out=left_out,
    )


def _beside(kind: AnyKind, predicted: Predicted, train: Sequence[Record]) -> dict[str, Column]:
    """Errors and noise floor of each further measured column."""
    found = {}
    for name in kind.channels[1:]:
        one = kind.alone(name)
        found[name] = Column(one.measure, one.unit, predicted.beside[name], one.noise_floor(train))
    return found


def _leading(choice: Choice) -> tuple[str, ...]:
    """Which stages may lead a controller, and why others must not."""
    if not (choice.possible or choice.barred):
        return ()
    able = [stage for stage in STAGES if stage not in choice.barred]
    barred = (TEXT("lead.barred", stage=stage, why=why) for stage, why in choice.barred.items())
    return (TEXT("lead.able", stages=able, n=len(able)), *barred)


def without_size(kind: AnyKind, sizes: Mapping[str, object]) -> dict[str, str]:
    """Why records cannot show an effect that has none of the `sizes` that they would show at least, by id."""
    return {effect.id: TEXT("lacking.size") for effect in kind.effects if sizes and effect.id not in sizes}


def _reasons(verdict: str, checks: Sequence[Check], findings: Sequence[RecordFinding]) -> tuple[str, ...]:
    """Why the verdict is `unknown`: what weakens the records, and the checks that fail."""
    if verdict != "unknown":
        return ()
    failed = []
    for check in (check for check in checks if not check.ok):
        name, _, column = check.id.partition(".")
        key = ".".join(("check", name, "failed"))
        said = TEXT(key, value=check.value, limit=check.limit, n=round(check.value))
        failed.append(f"{column}: {said}" if column else said)
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


def candidate_rows(found: Search, words: Callable[[str], str]) -> list[CandidateRow]:
    """Each candidate of each round and what became of it; a round adds one effect, the last one maybe none."""
    rows = []
    for (number, screened, trials), added in zip(found.rounds, [*found.gains, ""], strict=False):
        gains = {trial.effect: trial.gain for trial in trials}
        became_added = "dropped" if added in found.dropped else "added"
        for row in screened:
            if row.effect in found.equivalent.get(added, ()):
                note = TEXT("candidate.equivalent", added=words(added))
            else:
                became = became_added if row.effect == added else "fitted" if row.effect in gains else "screened"
                note = TEXT(f"candidate.{became}")
            rows.append(CandidateRow(row.effect, number, row.share, gains.get(row.effect), note))
    return rows


def _statements(
    kind: AnyKind, found: Search, predicted: Predicted, words: Callable[[str], str], ended: str
) -> list[str]:
    costs = {"before": found.before, "after": found.after, "chance": found.null_cost}
    said = [TEXT("statement.costs" if found.effects else "statement.cost", **costs, names=map(words, found.effects))]
    if found.effects:
        excess = found.before - found.null_cost  # the misfit beyond chance
        rest = 1 - (found.before - found.after) / excess if excess > 0 else 0.0
        constant, error = predicted.constant.get("train", np.inf), predicted.error["train"]
        if error["calibrated"] > constant:  # a base that diverges is no measure
            rest = (error["augmented"] / constant) ** 2
        said.append(TEXT("statement.explained", rest=float(np.clip(rest, 0.0, 1.0))))
    if found.horizon_s < np.inf:
        said.append(TEXT("statement.horizon", horizon=found.horizon_s))
    elif found.sensitivity > SET.clean * found.null_cost:
        said.append(TEXT("statement.sensitive", cost=found.sensitivity))
    for name in found.refinements:
        shaped = [words(effect) for effect in found.effects if name in kind.catalogue[effect].refined_by]
        said.append(sentence(TEXT("statement.refined", words=words(name), effects=shaped)))
    if ended != "time":  # that is left out
        _, screened, trials = found.rounds[-1] if found.rounds else (0, (), ())
        best = {"effect": words(trials[0].effect), "cost": float(trials[0].blocks.mean())} if trials else {}
        costs = {"limit": limit_of_chance(kind, found), "after": found.after}
        said.append(TEXT(f"statement.ended_{ended}", n=len(screened), effects=len(found.effects), **costs, **best))
    return said


def _proposed(kind: AnyKind, found: Search, predicted: Predicted) -> list[str]:
    """On which records an effect was proposed, if from a residual, and what follows from it."""
    said = []
    for name in found.effects:
        on = kind.catalogue[name].proposed_on
        again = [trace.name for trace in predicted.traces if trace.role == "train" and trace.name in on]
        tested = [trace.name for trace in predicted.traces if trace.role == "holdout" and trace.name not in on]
        if on:
            said += [
                TEXT("statement.proposed", effect=name, records=on),
                TEXT("statement.favoured" if again else "statement.unfavoured", records=again),
                TEXT("statement.tested" if tested else "statement.untested", records=tested, n=len(tested)),
            ]
    return said
