"""Which series of a campaign disagree: with the others of their kind, or with their own held-out records."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from scipy.stats import t as student

from hil.app.campaign.folders.answers import Answer
from hil.app.quantities import number

LEAST_OTHERS: Final = 4  # series beside one that tell whether it is unlike them
FALSE_ALARMS: Final = 0.01
"""Chance that any number of a kind of rig is called out where all rigs are alike."""


def with_disagreements(answers: Sequence[Answer]) -> list[Answer]:
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


def _lacks(alike: Sequence[Answer]) -> Iterator[tuple[str, str]]:
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


def _members(answer: Answer) -> set[str]:
    return {name for e in answer.effects for name in (e["id"], *e["equivalent"])}


def _numbers(alike: Sequence[Answer]) -> Iterator[tuple[str, str]]:
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
            limit = float(student.ppf(1 - 0.5 * FALSE_ALARMS / tests, count - 1))
            if abs(value - middle) > limit * spread > 0:
                yield (
                    series,
                    f"the others of its kind: {parameter} is {number(value, 3)}, theirs {number(middle, 3)} with a"
                    f" standard deviation of {number(float(others.std(ddof=1)), 2)}",
                )


def _values(alike: Sequence[Answer]) -> dict[str, dict[str, tuple[float, float]]]:
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
