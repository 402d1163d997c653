"""The page of a campaign over folders: what each rig lacks, how sure, how much better, which disagree."""

import math
from collections import Counter
from collections.abc import Sequence
from functools import partial
from statistics import median
from typing import Any, Final

from hil.app.campaign.series_answers import ORDER, TEXT, SeriesAnswer, comparisons, lacking, verdicts
from hil.report.builder import page
from hil.report.theme import STAGE_COLOURS
from models.words.quantities import number

MARKS: Final = {"named": "●", "none": "○", "unknown": "?", "refused": "✕"}
WIDTH, EDGE = 230, 9  # pixels of the drawing of a series


def page_html(answers: Sequence[SeriesAnswer], missing: int = 0, version: str = "") -> str:
    """One self-contained page without scripts; links to each series' own report beside it. Series that are still
    `missing` are told, and the `version` of the program.
    """
    lacks = lacking(answers)
    alike: dict[str, list[SeriesAnswer]] = {}
    for answer in answers:
        for said in answer.disagrees:
            alike.setdefault(said, []).append(answer)
    # the power of ten of the noise floor that every error of the page lies below
    shares = [error / a.floor for a in answers if a.floor > 0 for error in a.errors.values() if error > 0]
    most = max(1, math.ceil(math.log10(max([s for s in shares if math.isfinite(s)], default=1.0))))
    weak = Counter(name for answer in answers for name in answer.weak)
    return page(
        "series.html.j2",
        headline=headline(answers),
        lead=" ".join([*[TEXT("missing", count=missing)] * bool(missing), _lead(answers)]),
        version=version,
        lacking=lacks,
        bar=160 / max((named + part for _, named, part in lacks), default=1),
        disagreeing=alike,
        comparisons=comparisons(answers),
        series=sorted(answers, key=lambda a: (ORDER.index(a.verdict), not a.disagrees, a.name)),
        marks=MARKS,
        most=most,
        drawing=partial(_drawn, most),
        colours=STAGE_COLOURS,
        findings=weak.most_common(),
    )


def headline(answers: Sequence[SeriesAnswer]) -> str:
    counts = {verdict: count for verdict in MARKS if (count := verdicts(answers)[verdict])}
    words = [TEXT(f"verdicts.{verdict}", count=count) for verdict, count in counts.items()]
    return TEXT("headline", count=len(answers), verdicts=words)


def _lead(answers: Sequence[SeriesAnswer]) -> str:
    compared = [answer for answer in answers if math.isfinite(answer.better)]
    if not compared:
        return TEXT("no_error")
    held, count = sum(answer.part == "holdout" for answer in compared), len(compared)
    where = TEXT("held_out") if held == count else TEXT("partly_held_out", held=held, count=count)
    return TEXT("better", where=where, times=float(median(answer.better for answer in compared)))


def _drawn(most: int, answer: SeriesAnswer) -> dict[str, Any] | None:
    """A series on an axis from a half to 10^`most` noise floors: positions in px of its stages, the augmented one only
    where it has an effect, and of the axis' marks. None without a noise floor.
    """

    def at(share: float) -> float:
        shown = math.log(2 * share) / math.log(2 * 10.0**most)
        return EDGE + (WIDTH - 2 * EDGE) * min(max(shown, 0.0), 1.0)

    if not answer.floor > 0:
        return None
    shown = [stage for stage in STAGE_COLOURS if stage != "augmented" or answer.effects]
    shares = {stage: answer.errors[stage] / answer.floor for stage in shown if answer.errors[stage] > 0}
    return {
        "said": ", ".join(f"{stage} {number(share, 3)}" for stage, share in shares.items()),
        "stages": [(stage, at(share)) for stage, share in shares.items()],
        "decades": [at(10.0**power) for power in range(1, 1 + most)],
        "floor": at(1.0),
    }
