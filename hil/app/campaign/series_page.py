"""The page of a campaign over folders: what each rig lacks, how sure, how much better, which disagree."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any, Final

from hil.app.campaign.series_answers import ORDER, SeriesAnswer, lacking, verdicts
from hil.report.builder import page
from hil.report.theme import FLOOR, GRID, INK, STAGE_COLOURS
from models.words.quantities import number
from models.words.sentences import listed

MARKS: Final = {"named": "●", "none": "○", "unknown": "?", "refused": "✕"}
WIDTH, EDGE = 230, 9  # pixels of the drawing of a series
_WORDS: Final = {
    "named": "lack a named effect",
    "none": "lack nothing",
    "unknown": "without a verdict",
    "refused": "could not be used",
}


def page_html(answers: Sequence[SeriesAnswer]) -> str:
    """One self-contained page without scripts; links to each series' own report beside it."""
    lacks = lacking(answers)
    most = _decades(answers)
    weak = Counter(name for answer in answers for name in answer.weak)
    return page(
        "series.html.j2",
        headline=headline(answers),
        story=_story(answers),
        lacking=lacks,
        bar=160 / max((named + part for _, named, part in lacks), default=1),
        disagreeing=_alike(answers),
        series=sorted(answers, key=lambda a: (ORDER.index(a.verdict), not a.disagrees, a.name)),
        marks=MARKS,
        most=most,
        drawing=_drawing(most),
        colours={"floor": FLOOR, "grid": GRID, "ink": INK, **STAGE_COLOURS},
        findings=weak.most_common(),
    )


def headline(answers: Sequence[SeriesAnswer]) -> str:
    """How many series, and how many of each verdict."""
    counts = verdicts(answers)
    return f"{len(answers)} series: {listed(f'{counts[v]} {what}' for v, what in _WORDS.items() if counts[v])}"


def _story(answers: Sequence[SeriesAnswer]) -> str:
    told = [answer for answer in answers if math.isfinite(answer.better)]
    if not told:
        return "No series has an error before and after."
    held = sum(answer.part == "holdout" for answer in told)
    where = (
        "held-out records" if held == len(told) else f"held-out records ({held} of {len(told)} series; else training)"
    )
    middle = number(median(answer.better for answer in told), 3)
    return f"At the median the error on {where} is {middle} times smaller than that of the nominal model."


def _alike(answers: Sequence[SeriesAnswer]) -> dict[str, list[SeriesAnswer]]:
    """What is disagreed in, with the series that do."""
    alike: dict[str, list[SeriesAnswer]] = {}
    for answer in answers:
        for said in answer.disagrees:
            alike.setdefault(said, []).append(answer)
    return alike


def _decades(answers: Sequence[SeriesAnswer]) -> int:
    """The power of ten of the noise floor that every error of a page lies below."""
    shares = [error / a.floor for a in answers if a.floor > 0 for error in a.errors.values() if error > 0]
    return max(1, math.ceil(math.log10(max([s for s in shares if math.isfinite(s)], default=1.0))))


def _drawing(most: int) -> Callable[[SeriesAnswer], dict[str, Any] | None]:
    """What is drawn of a series on an axis from a half to 10^`most` noise floors: the places in px and the shares of
    its stages, the augmented one only where it has an effect, and of the axis' marks. None without a noise floor.
    """

    def place(share: float) -> float:
        shown = math.log(2 * share) / math.log(2 * 10.0**most)
        return EDGE + (WIDTH - 2 * EDGE) * min(max(shown, 0.0), 1.0)

    def drawn(answer: SeriesAnswer) -> dict[str, Any] | None:
        if not answer.floor > 0:
            return None
        shown = [stage for stage in STAGE_COLOURS if stage != "augmented" or answer.effects]
        shares = {stage: answer.errors[stage] / answer.floor for stage in shown if answer.errors[stage] > 0}
        return {
            "said": ", ".join(f"{stage} {number(share, 3)}" for stage, share in shares.items()),
            "stages": [(stage, place(share)) for stage, share in shares.items()],
            "decades": [place(10.0**power) for power in range(1, 1 + most)],
            "floor": place(1.0),
        }

    return drawn
