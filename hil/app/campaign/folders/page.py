"""The page of a campaign over folders: what each rig lacks, how sure, how much better, which disagree."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from statistics import median
from typing import Final
from urllib.parse import quote

from hil.app.campaign.folders.answers import ORDER, Answer, lacking, verdicts
from hil.app.quantities import DASH, number, quantity
from hil.app.report.document import STYLE
from hil.app.report.theme import FLOOR, GRID, INK, STAGE_COLOURS
from hil.app.report.words import listed

OWN_STYLE: Final = Path(__file__).with_name("page.css")
MARKS: Final = {"named": "●", "none": "○", "unknown": "?", "refused": "✕"}
_HEADS: Final = ("series", "verdict", "what it lacks", "how sure", "error, nominal to last", "how much better", "")


WIDTH, HEIGHT, EDGE = 230, 22, 9  # pixels
_SHAPES: Final = {
    "nominal": '<rect x="{a:.1f}" y="{b:.1f}" width="9" height="9" fill="white" stroke="{ink}" stroke-width="1.5"/>',
    "calibrated": '<path d="M{x:.1f} {t:.1f} l6 6 l-6 6 l-6 -6 z" fill="{colour}" stroke="{ink}"/>',
    "augmented": '<circle cx="{x:.1f}" cy="{y:.1f}" r="5.5" fill="{colour}" stroke="{ink}"/>',
}
"""Shapes as well as colours: a square, a diamond and a disc."""


def page_html(answers: Sequence[Answer]) -> str:
    """One self-contained page without scripts; links to each series' own report beside it."""
    style = STYLE.read_text(encoding="utf-8") + OWN_STYLE.read_text(encoding="utf-8")
    sections = (
        ("What they lack", _lacking(answers)),
        ("Which disagree", _disagreeing(answers)),
        ("Each series", _series_table(answers)),
        ("What weakens the records", _findings(answers)),
    )
    body = "".join(f"<section><h2>{title}</h2>{content}</section>" for title, content in sections if content)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(headline(answers))}</title><style>{style}</style></head><body><main>"
        f'<header><p class="eyebrow">Campaign · close-loop</p><h1>{escape(headline(answers))}</h1>'
        f'<p class="story">{escape(_story(answers))}</p></header>{body}</main></body></html>\n'
    )


def headline(answers: Sequence[Answer]) -> str:
    """How many series, and how many of each verdict."""
    counts = verdicts(answers)
    words = {
        "named": "lack a named effect",
        "none": "lack nothing",
        "unknown": "without a verdict",
        "refused": "could not be used",
    }
    said = listed(f"{counts[verdict]} {what}" for verdict, what in words.items() if counts[verdict])
    return f"{len(answers)} series: {said}"


def _story(answers: Sequence[Answer]) -> str:
    told = [answer for answer in answers if math.isfinite(answer.better)]
    if not told:
        return "No series has an error before and after."
    held = sum(answer.part == "holdout" for answer in told)
    where = (
        "held-out records" if held == len(told) else f"held-out records ({held} of {len(told)} series; else training)"
    )
    middle = number(median(answer.better for answer in told), 3)
    return f"At the median the error on {where} is {middle} times smaller than that of the nominal model."


def _lacking(answers: Sequence[Answer]) -> str:
    rows = lacking(answers)
    if not rows:
        return ""
    most = max(named + part for _, named, part in rows)
    lines = [
        [escape(effect), str(named or DASH), str(part or DASH), _bar(named, part, most)] for effect, named, part in rows
    ]
    note = "<p>In series without a verdict an effect may still explain a part of the residual.</p>"
    return _table(("effect", "named by", "a part in", ""), lines) + note


def _bar(named: int, part: int, most: int) -> str:
    full, half = (160 * count / most for count in (named, part))
    return (
        '<svg width="164" height="14" role="img" aria-hidden="true">'
        f'<rect x="1" y="2" width="{full:.1f}" height="10" fill="#0b7a84"/>'
        f'<rect x="{1 + full:.1f}" y="2" width="{half:.1f}" height="10" fill="white" stroke="#0b7a84"/></svg>'
    )


def _disagreeing(answers: Sequence[Answer]) -> str:
    alike: dict[str, list[Answer]] = {}
    for answer in answers:
        for said in answer.disagrees:
            alike.setdefault(said, []).append(answer)
    verbs = {said: "disagrees" if len(those) == 1 else "each disagrees" for said, those in alike.items()}
    lines = [
        f"<li>{', '.join(map(_link, alike[said]))}: {verb} with {escape(said)}</li>" for said, verb in verbs.items()
    ]
    if lines:
        return f"<ul>{''.join(lines)}</ul>"
    return "<p>None: series of one kind lack the same, as far as they tell, and their numbers go together.</p>"


def _series_table(answers: Sequence[Answer]) -> str:
    axis = Axis.of(answers)
    ordered = sorted(answers, key=lambda a: (ORDER.index(a.verdict), not a.disagrees, a.name))
    return legend(axis) + _table(_HEADS, [_line(answer, axis) for answer in ordered])


def _line(answer: Answer, axis: Axis) -> list[str]:
    chip = f'<span class="told {answer.verdict}">{MARKS[answer.verdict]} {answer.verdict}</span>'
    kind = f"<small>{escape(answer.kind.replace('_', ' '))}</small>" if answer.kind else ""
    if answer.error:
        return [_link(answer) + kind, chip, escape(answer.error), "", "", "", ""]
    unit = answer.result["error"].get("unit") or ""
    first, last = (quantity(answer.errors[stage], unit) for stage in ("nominal", "augmented"))
    held = "" if answer.part == "holdout" else "<small>on training records</small>"
    times = f"{number(answer.better, 3)}&nbsp;×" if math.isfinite(answer.better) else DASH
    errors = f"<span>{first} →</span> <span>{last}</span>{held}"
    said = [_lacks(answer), answer.sure or DASH, errors, times]
    return [_link(answer) + kind, chip, *said, error_drawing(answer, axis)]


def _lacks(answer: Answer) -> str:
    part = "a part: " if answer.effects and answer.verdict == "unknown" else ""
    said = escape(part + answer.lacks) if answer.effects else ("nothing" if answer.verdict == "none" else DASH)
    more = [*answer.result.get("reasons", []), *filter(None, [answer.result.get("next_experiment")])]
    listing = "".join(f"<li>{escape(reason)}</li>" for reason in more)
    why = "why, and what to record next" if answer.verdict == "unknown" else "what to record next"
    return said + (f"<details><summary>{why}</summary><ul>{listing}</ul></details>" if more else "")


def _findings(answers: Sequence[Answer]) -> str:
    count: Counter[str] = Counter()
    for answer in answers:
        found = answer.result.get("findings", [])
        count.update({finding["id"] for finding in found if finding["severity"] == "weakens"})
    lines = [[escape(name.replace("_", " ")), str(times)] for name, times in count.most_common()]
    return _table(("finding", "series"), lines) if lines else ""


def _link(answer: Answer) -> str:
    name = escape(answer.name)
    return f'<a href="{quote(answer.report)}/report.html">{name}</a>' if answer.report else f"<b>{name}</b>"


def _table(heads: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table whose rows become cards where the page is narrow."""
    head = "".join(f"<th>{escape(h)}</th>" for h in heads)
    body = ""
    for line in lines:
        body += "<tr>"
        for h, cell in zip(heads, line, strict=True):
            body += f'<td{"" if cell else " class=empty"} data-head="{escape(h)}">{cell}</td>'
        body += "</tr>"
    return f'<table class="cards"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'


@dataclass(frozen=True)
class Axis:
    """From a half to `most` times the noise floor; the same for all series of a page."""

    most: float

    @classmethod
    def of(cls, answers: Sequence[Answer]) -> Axis:
        """Wide enough for every series, to a whole power of ten."""
        shares = [error / a.floor for a in answers if a.floor > 0 for error in a.errors.values() if error > 0]
        return cls(10.0 ** max(1, math.ceil(math.log10(max([s for s in shares if math.isfinite(s)], default=1.0)))))

    def place(self, share: float) -> float:
        """Where a share of the floor stands, px."""
        room = math.log(2 * self.most)
        return EDGE + (WIDTH - 2 * EDGE) * min(max(math.log(2 * share) / room, 0.0), 1.0)


def error_drawing(answer: Answer, axis: Axis) -> str:
    """The drawing of one series; empty where it has no noise floor. The augmented model only where it has an effect."""
    if not answer.floor > 0:
        return ""
    shown = [stage for stage in _SHAPES if stage != "augmented" or answer.effects]
    shares = {stage: answer.errors[stage] / answer.floor for stage in shown if answer.errors[stage] > 0}
    said = ", ".join(f"{stage} {number(share, 3)}" for stage, share in shares.items())
    marks = "".join(_mark(stage, axis.place(share)) for stage, share in shares.items())
    decades = "".join(_stroke(axis.place(10.0**power), GRID) for power in range(1, 1 + round(math.log10(axis.most))))
    return (
        f'<svg width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="times the noise'
        f' floor: {said}"><title>times the noise floor: {said}</title>'
        f'<line x1="{EDGE}" x2="{WIDTH - EDGE}" y1="11" y2="11" stroke="{GRID}"/>'
        f"{decades}{_stroke(axis.place(1.0), FLOOR)}{marks}</svg>"
    )


def legend(axis: Axis) -> str:
    """What the marks are."""
    marks = "".join(
        f'<span><svg width="18" height="{HEIGHT}">{_mark(stage, 9.0)}</svg> {stage}</span>' for stage in _SHAPES
    )
    return (
        f'<p class="legend">Errors on records that no fit has seen, where there are any, over the noise floor (dark'
        f" line; a light line each ten times, up to {number(axis.most)}): {marks}</p>"
    )


def _mark(stage: str, x: float) -> str:
    y = 0.5 * HEIGHT
    return _SHAPES[stage].format(x=x, y=y, a=x - 4.5, b=y - 4.5, t=y - 6, colour=STAGE_COLOURS[stage], ink=INK)


def _stroke(x: float, colour: str) -> str:
    return f'<line x1="{x:.1f}" x2="{x:.1f}" y1="1" y2="{HEIGHT - 1}" stroke="{colour}" stroke-width="1.5"/>'
