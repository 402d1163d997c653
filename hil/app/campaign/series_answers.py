"""What each series of a campaign answered; which disagree with others of their kind or their held-out records."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import scipy

from models.effects import effect_words
from models.identification.finding import STAGES
from models.words.sentences import Sentences, listed

TEXT: Final = Sentences(__file__)
OUTSIDE: Final = "outside"
"""The `cause` of a run that failed for a cause outside itself: it is done again at the next start."""
ORDER: Final = ("refused", "unknown", "named", "none")  # The verdicts, those that need a look first
LEAST_OTHERS: Final = 4  # series beside one that show whether it is unlike them
LEAST_ALIKE: Final = 3  # series that make an answer usual
FALSE_ALARMS: Final = 0.01  # Probability that any number of a kind of rig is called out where all rigs are alike


@dataclass(frozen=True)
class SeriesAnswer:
    """One series. `report` is the folder of its report, seen from the page; `error` says why it could not be used, then
    its verdict is "refused". `effects` are those of `report.json`; `lacks` has them in words, each with its equivalent
    effects. `errors` by stage are in the report's unit, on `part` of the data: held out where there is any, else
    training. `better` says how many times smaller the last one is than the nominal one. `confidence` is that of the
    least sure effect, `calibrated` where it is a probability. `weak` are ids of findings that weaken the verdict.
    """

    name: str
    result: Mapping[str, Any]
    report: str
    error: str
    verdict: str
    kind: str
    effects: Sequence[Mapping[str, Any]]
    lacks: str
    confidence: float
    calibrated: bool
    part: str
    errors: Mapping[str, float]
    floor: float
    better: float
    weak: frozenset[str]
    disagrees: tuple[str, ...] = ()


def answer_of(name: str, row: Mapping[str, Any], report: str) -> SeriesAnswer:
    result, error = row.get("result", {}), reason_of(row).removeprefix("ValueError: ")
    effects, found = list(result.get("effects", [])), result.get("error", {})
    part = "holdout" if any(value is not None for value in found.get("holdout", {}).values()) else "train"
    errors = {stage: _number(found.get(part, {}).get(stage)) for stage in STAGES}
    return SeriesAnswer(
        name=name,
        result=result,
        report="" if error else report,
        error=error,
        verdict=str(result.get("verdict", "refused")),
        kind=str(result.get("kind", "")),
        effects=effects,
        lacks=listed(map(_class_words, effects)),
        confidence=min((float(effect["confidence"]) for effect in effects), default=math.nan),
        calibrated=all(effect.get("confidence_calibrated", False) for effect in effects),
        part=part,
        errors=errors,
        floor=_number(found.get("noise_floor")),
        better=errors["nominal"] / errors["augmented"] if errors["augmented"] > 0 else math.nan,
        weak=frozenset(found["id"] for found in result.get("findings", []) if found["severity"] == "weakens"),
    )


def reason_of(row: Mapping[str, Any]) -> str:
    """Why the run of a row failed, "" where it did not; and that the next start does it again, where it does."""
    error = str(row.get("error", ""))
    return TEXT("again", error=error) if row.get("cause") == OUTSIDE else error


def _class_words(effect: Mapping[str, Any]) -> str:
    return listed(map(effect_words, (effect["id"], *effect["equivalent"])), "or")


def lacking(answers: Iterable[SeriesAnswer]) -> list[tuple[str, int, int]]:
    """Each class of effects, how many series name it and how many in part; the most frequent first."""
    named: Counter[str] = Counter()
    part: Counter[str] = Counter()
    for answer in answers:
        counted = named if answer.verdict == "named" else part
        counted.update(set(map(_class_words, answer.effects)))
    return sorted(((e, named[e], part[e]) for e in {*named, *part}), key=lambda row: (-row[1], -row[2], row[0]))


def verdicts(answers: Sequence[SeriesAnswer]) -> dict[str, int]:
    return {verdict: sum(answer.verdict == verdict for answer in answers) for verdict in ORDER}


def document(answers: Sequence[SeriesAnswer]) -> dict[str, Any]:
    return {
        "campaign": "close-loop",
        "verdicts": verdicts(answers),
        "lacking": [{"effects": effect, "named": named, "part": part} for effect, named, part in lacking(answers)],
        "series": [
            {name: getattr(answer, name) for name in ("name", "kind", "verdict", "effects", "part")}
            | {"error": answer.errors, "noise_floor": answer.floor, "better": answer.better}
            | {"disagrees": list(answer.disagrees), "reasons": answer.result.get("reasons", [])}
            | {"report": answer.report, "refused": answer.error, "seconds": answer.result.get("seconds")}
            for answer in answers
        ],
    }


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else math.nan


def with_disagreements(answers: Sequence[SeriesAnswer]) -> list[SeriesAnswer]:
    said: dict[str, list[str]] = {answer.name: [] for answer in answers}
    for kind in {answer.kind for answer in answers if answer.kind}:
        alike = [answer for answer in answers if answer.kind == kind]
        for name, sentence in (*_lacks(alike), *_numbers(alike)):
            said[name].append(sentence)
    for answer in answers:
        errors = answer.errors
        if answer.effects and answer.part == "holdout" and errors["augmented"] >= errors["calibrated"]:
            said[answer.name].append(TEXT("disagreement.own"))
    return [replace(answer, disagrees=tuple(said[answer.name])) for answer in answers]


def _decided(alike: Sequence[SeriesAnswer]) -> tuple[list[SeriesAnswer], str | None, int]:
    """The series with a verdict, the answer of more than half (three or more) or None, and the highest count."""
    decided = [answer for answer in alike if answer.verdict in ("named", "none")]
    usual, count = Counter(answer.lacks for answer in decided).most_common(1)[0] if decided else ("", 0)
    return decided, usual if count >= LEAST_ALIKE and 2 * count > len(decided) else None, count


def _lacks(alike: Sequence[SeriesAnswer]) -> Iterator[tuple[str, str]]:
    decided, usual, count = _decided(alike)
    if usual is None:
        return
    classes = _members(next(answer for answer in decided if answer.lacks == usual))
    for answer in decided:
        if answer.lacks != usual and not (classes & _members(answer)):
            own, others = (words or TEXT("disagreement.nothing") for words in (answer.lacks, usual))
            decisions = {"count": count, "decided": len(decided), "usual": others}
            yield answer.name, TEXT("disagreement.effects", own=own, **decisions)


def comparisons(answers: Sequence[SeriesAnswer]) -> list[str]:
    """For each kind of rig what its series have in common, or why they could not be compared."""
    said = []
    for kind in dict.fromkeys(answer.kind for answer in answers if answer.kind):
        decided, usual, count = _decided([answer for answer in answers if answer.kind == kind])
        numbers = {"kind": kind.replace("_", " "), "decided": len(decided), "count": count}
        numbers["answers"] = len({answer.lacks for answer in decided})
        if usual is not None:
            said.append(TEXT("compared.usual", usual=usual or TEXT("disagreement.nothing"), **numbers))
        else:
            said.append(TEXT("compared.few" if len(decided) < LEAST_ALIKE else "compared.different", **numbers))
        if len(decided) <= LEAST_OTHERS:
            said[-1] += " " + TEXT("compared.no_numbers", least=LEAST_OTHERS + 1)
    return said


def _members(answer: SeriesAnswer) -> set[str]:
    return {name for e in answer.effects for name in (e["id"], *e["equivalent"])}


def _numbers(alike: Sequence[SeriesAnswer]) -> Iterator[tuple[str, str]]:
    """Parameters outside the prediction interval (Student's t) of the others' values; each is at least as uncertain as
    its own interval says. `FALSE_ALARMS` holds over all numbers of the kind.
    """
    tables = {name: values for name, values in _values(alike).items() if len(values) > LEAST_OTHERS}
    tests = sum(map(len, tables.values()))
    for parameter, values in tables.items():
        for series, (value, deviation) in values.items():
            others = np.array([v for name, (v, _) in values.items() if name != series])
            count, middle = len(others), float(others.mean())
            spread = float(others.std(ddof=1))
            uncertain = max(spread * np.sqrt(1 + 1 / count), deviation)
            limit = float(scipy.special.stdtrit(count - 1, 1 - 0.5 * FALSE_ALARMS / tests))
            if abs(value - middle) > limit * uncertain > 0:
                numbers = {"parameter": parameter, "value": value, "mean": middle, "spread": spread}
                yield series, TEXT("disagreement.number", **numbers)


def _values(alike: Sequence[SeriesAnswer]) -> dict[str, dict[str, tuple[float, float]]]:
    """Value and standard deviation of every identifiable parameter, by parameter and series."""
    found: dict[str, dict[str, tuple[float, float]]] = {}
    for answer in alike:
        named = [(f"{e['id']} {name}", p) for e in answer.effects for name, p in e["parameters"].items()]
        estimates: list[tuple[str, Mapping[str, Any]]] = [*answer.result.get("calibration", {}).items(), *named]
        for name, estimate in estimates:
            if estimate["told"] and None not in (estimate["value"], *estimate["ci95"]):
                low, high = estimate["ci95"]
                found.setdefault(name, {})[answer.name] = estimate["value"], (high - low) / 3.92
    return found
