"""What each series of a campaign answered, in the few numbers that a page of all of them needs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from hil.app.report.words import effect_words, listed
from models.identification.finding import STAGES

Row = Mapping[str, Any]
ORDER: Final = ("refused", "unknown", "named", "none")
"""What becomes of a series, what needs a look first."""


@dataclass(frozen=True)
class Answer:
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
    def weak(self) -> int:
        """Findings on its records that weaken a verdict."""
        return sum(finding["severity"] == "weakens" for finding in self.result.get("findings", []))


def answer_of(name: str, row: Row, report: str) -> Answer:
    """The answer in a row of the results."""
    error = str(row.get("error", "")).removeprefix("ValueError: ")
    return Answer(name, row.get("result", {}), "" if error else report, error)


def lacking(answers: Iterable[Answer]) -> list[tuple[str, int, int]]:
    """Every class of effects with how many series name it and for how many it is but a part, the most frequent
    first.
    """
    named: Counter[str] = Counter()
    part: Counter[str] = Counter()
    for answer in answers:
        counted = named if answer.verdict == "named" else part
        counted.update({" or ".join(map(effect_words, (e["id"], *e["equivalent"]))) for e in answer.effects})
    return sorted(((e, named[e], part[e]) for e in {*named, *part}), key=lambda row: (-row[1], -row[2], row[0]))


def verdicts(answers: Sequence[Answer]) -> dict[str, int]:
    """How many series have each verdict, and how many were refused."""
    return {verdict: sum(answer.verdict == verdict for answer in answers) for verdict in ORDER}


def document(answers: Sequence[Answer]) -> dict[str, Any]:
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
