"""What each series of a campaign answered, in the few numbers that a page of all of them needs, and which disagree with
the others of their kind or with their own held-out records.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import scipy

from models.effects import effect_words
from models.identification.finding import STAGES
from models.words.quantities import number
from models.words.sentences import listed

Row = Mapping[str, Any]
ORDER: Final = ("refused", "unknown", "named", "none")
"""What becomes of a series, what needs a look first."""


LEAST_OTHERS: Final = 4  # series beside one that tell whether it is unlike them
FALSE_ALARMS: Final = 0.01
"""Chance that any number of a kind of rig is called out where all rigs are alike."""


@dataclass(frozen=True)
class SeriesAnswer:
    """One series: `report` is the folder of its report, seen from the page, `error` why it could not be used."""

    name: str
    result: Row
    report: str = ""
    error: str = ""
    disagrees: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """The report's verdict, or "refused"."""
        return str(self.result.get("verdict", "refused"))

    @property
    def kind(self) -> str:
        """Kind of rig; empty where the series could not be used."""
        return str(self.result.get("kind", ""))

    @property
    def effects(self) -> list[dict[str, Any]]:
        """The effects as `report.json` has them."""
        return list(self.result.get("effects", []))

    @property
    def lacks(self) -> str:
        """The effects in words, each with what the records cannot tell it apart from."""
        return listed(" or ".join(map(effect_words, (e["id"], *e["equivalent"]))) for e in self.effects)

    @property
    def sure(self) -> str:
        """How sure its effects are, where that is calibrated; empty where there are none."""
        if not self.effects:
            return ""
        told = all(e.get("confidence_calibrated", False) for e in self.effects)
        return f"{100 * self.confidence:.3g}\u00a0%" if told else "not calibrated"

    @property
    def confidence(self) -> float:
        """Of the least sure of the effects; NaN where there are none."""
        return min((float(e["confidence"]) for e in self.effects), default=math.nan)

    @property
    def part(self) -> str:
        """The part of the data whose errors tell most: held out where there is any, else training."""
        errors = self.result.get("error", {})
        held = errors.get("holdout", {})
        return "holdout" if any(value is not None for value in held.values()) else "train"

    @property
    def errors(self) -> dict[str, float]:
        """Error by stage on `part`, in the unit of the report; NaN where there is none."""
        found = self.result.get("error", {}).get(self.part, {})
        return {stage: _number(found.get(stage)) for stage in STAGES}

    @property
    def floor(self) -> float:
        """The noise floor in the same unit."""
        return _number(self.result.get("error", {}).get("noise_floor"))

    @property
    def better(self) -> float:
        """How many times smaller than nominal the error of the last model is."""
        last = self.errors["augmented"]
        return self.errors["nominal"] / last if last > 0 else math.nan

    @property
    def weak(self) -> set[str]:
        """Ids of findings on its records that weaken a verdict."""
        return {found["id"] for found in self.result.get("findings", []) if found["severity"] == "weakens"}


def answer_of(name: str, row: Row, report: str) -> SeriesAnswer:
    """The answer in a row of the results."""
    error = str(row.get("error", "")).removeprefix("ValueError: ")
    return SeriesAnswer(name, row.get("result", {}), "" if error else report, error)


def lacking(answers: Iterable[SeriesAnswer]) -> list[tuple[str, int, int]]:
    """Every class of effects: how many series name it, and how many in part; the most frequent first."""
    named: Counter[str] = Counter()
    part: Counter[str] = Counter()
    for answer in answers:
        counted = named if answer.verdict == "named" else part
        counted.update({" or ".join(map(effect_words, (e["id"], *e["equivalent"]))) for e in answer.effects})
    return sorted(((e, named[e], part[e]) for e in {*named, *part}), key=lambda row: (-row[1], -row[2], row[0]))


def verdicts(answers: Sequence[SeriesAnswer]) -> dict[str, int]:
    """How many series have each verdict, and how many were refused."""
    return {verdict: sum(answer.verdict == verdict for answer in answers) for verdict in ORDER}


def document(answers: Sequence[SeriesAnswer]) -> dict[str, Any]:
    """The campaign's numbers as JSON has them."""
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
    """The answers, each with what it disagrees in, as sentences."""
    said: dict[str, list[str]] = {answer.name: [] for answer in answers}
    for kind in {answer.kind for answer in answers if answer.kind}:
        alike = [answer for answer in answers if answer.kind == kind]
        for name, sentence in (*_lacks(alike), *_numbers(alike)):
            said[name].append(sentence)
    for answer in answers:
        errors = answer.errors
        if answer.effects and answer.part == "holdout" and errors["augmented"] >= errors["calibrated"]:
            said[answer.name].append("its held-out records: the augmented model errs no less than the calibrated one")
    return [replace(answer, disagrees=tuple(said[answer.name])) for answer in answers]


def _lacks(alike: Sequence[SeriesAnswer]) -> Iterator[tuple[str, str]]:
    """Where more than half of the series with a verdict, and at least three, have one answer: those with another, of
    which no class holds an effect of it.
    """
    decided = [answer for answer in alike if answer.verdict in ("named", "none")]
    answers = Counter(answer.lacks for answer in decided)
    if not answers:
        return
    usual, count = answers.most_common(1)[0]
    if count < 3 or 2 * count <= len(decided):
        return
    classes = _members(next(answer for answer in decided if answer.lacks == usual))
    for answer in decided:
        if answer.lacks != usual and not (classes & _members(answer)):
            what = f"lacks {answer.lacks}" if answer.effects else "lacks nothing"
            others = f"lack {usual}" if usual else "lack nothing"
            yield answer.name, f"the others of its kind: it {what}, {count} of {len(decided)} {others}"


def _members(answer: SeriesAnswer) -> set[str]:
    return {name for e in answer.effects for name in (e["id"], *e["equivalent"])}


def _numbers(alike: Sequence[SeriesAnswer]) -> Iterator[tuple[str, str]]:
    """Parameters outside the prediction interval (Student's t) of the others' values, each at least as uncertain as
    its own interval says; over all numbers of the kind `FALSE_ALARMS`.
    """
    tables = {name: values for name, values in _values(alike).items() if len(values) > LEAST_OTHERS}
    tests = sum(map(len, tables.values()))
    for parameter, values in tables.items():
        for series, (value, deviation) in values.items():
            others = np.array([v for name, (v, _) in values.items() if name != series])
            count, middle = len(others), float(others.mean())
            spread = max(float(others.std(ddof=1)) * np.sqrt(1 + 1 / count), deviation)
            limit = float(scipy.stats.t.ppf(1 - 0.5 * FALSE_ALARMS / tests, count - 1))
            if abs(value - middle) > limit * spread > 0:
                yield (
                    series,
                    f"the others of its kind: {parameter} is {number(value, 3)}, theirs {number(middle, 3)} with a"
                    f" standard deviation of {number(float(others.std(ddof=1)), 2)}",
                )


def _values(alike: Sequence[SeriesAnswer]) -> dict[str, dict[str, tuple[float, float]]]:
    """Value and standard deviation of every parameter that is told, by parameter and series."""
    found: dict[str, dict[str, tuple[float, float]]] = {}
    for answer in alike:
        named = [(f"{e['id']} {name}", p) for e in answer.effects for name, p in e["parameters"].items()]
        estimates: list[tuple[str, Mapping[str, Any]]] = [*answer.result.get("calibration", {}).items(), *named]
        for name, estimate in estimates:
            if estimate["told"] and None not in (estimate["value"], *estimate["ci95"]):
                low, high = estimate["ci95"]
                found.setdefault(name, {})[answer.name] = estimate["value"], (high - low) / 3.92
    return found
