"""Tables of the report: errors, parameters with their intervals, checks with their limits, candidates, records,
times.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from hil.app.report.words import DASH, STAGE_WORDS, effect_words, error_scale, number, scaled
from models.identification.finding import STAGES, Estimate, Finding

PARTS = {"train": "training", "holdout": "held out"}


def table(head: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> str:
    """An HTML table; cells are HTML; the first `left` columns are words, the others numbers."""
    classes = ["word" if column < left else "" for column in range(len(head))]
    header = "".join(f'<th class="{c}">{h}</th>' for c, h in zip(classes, head, strict=True))
    body = "".join(
        "<tr>" + "".join(f'<td class="{c}">{cell}</td>' for c, cell in zip(classes, row, strict=True)) + "</tr>"
        for row in rows
    )
    return f'<div class="scroll"><table><thead><tr>{header}</tr></thead><tbody>{body}</tbody></table></div>'


def error_table(finding: Finding) -> str:
    """Errors by part and stage, and how much of the nominal error is gone."""
    factor, unit = error_scale(finding)
    rows = []
    for part, words in PARTS.items():
        errors = finding.error.get(part, {})
        first, last = errors.get("nominal", math.nan), errors.get("augmented", math.nan)
        gone = f"{100 * (1 - last / first):.0f} %" if first and math.isfinite(first) and math.isfinite(last) else DASH
        shown = [number(scaled(errors.get(stage), factor), 3) for stage in STAGES]
        rows.append([words, *shown, gone, number(factor * finding.noise_floor, 3)])
    head = f"error in {unit}" if unit else "error"
    return table([head, *(STAGE_WORDS[stage] for stage in STAGES), "gone", "noise floor"], rows)


def parameter_table(estimates: dict[str, Estimate], nominal: dict[str, float] | None = None) -> str:
    """Parameters with their 95 % intervals; against the nominal values where there are any."""
    rows = []
    for name, estimate in estimates.items():
        interval = (
            f"{number(estimate.ci95[0])} … {number(estimate.ci95[1])}"
            if estimate.told
            else '<span class="untold">the data cannot tell</span>'
        )
        unit = "" if estimate.unit == "1" else escape(estimate.unit)
        believed = (
            [] if nominal is None else [number(nominal.get(name)), _interval_drawing(nominal.get(name), estimate)]
        )
        rows.append(
            [f"<code>{escape(name)}</code>", unit, *believed[:1], number(estimate.value), interval, *believed[1:]]
        )
    if nominal is None:
        return table(["parameter", "unit", "value", "95 % interval"], rows, left=2)
    return table(["parameter", "unit", "nominal", "calibrated", "95 % interval", "change from nominal"], rows, left=2)


def check_table(finding: Finding) -> str:
    """Checks of the residual with the limits that chance sets."""
    rows = []
    for check in finding.checks:
        mark = '<span class="pass">within</span>' if check.ok else '<span class="fail">beyond</span>'
        rows.append(
            [
                escape(check.name),
                escape(check.meaning),
                number(check.value, 3),
                number(check.limit, 3),
                _bar(check.value, check.limit),
                mark,
            ]
        )
    return table(["check", "what it asks", "value", "limit by chance", "", ""], rows, left=2)


def candidate_table(finding: Finding) -> str:
    """All candidates of all rounds."""
    rows = [
        [effect_words(row.id), escape(row.note), str(row.round), f"{100 * row.screened:.3g} %", number(row.gain, 3)]
        for row in finding.candidates
    ]
    return table(["candidate", "what became of it", "round", "screened", "gain"], rows, left=2)


def record_table(finding: Finding) -> str:
    """The records: name, role, samples, span."""
    rows = []
    for trace in finding.traces:
        x = np.asarray(trace.abscissa, dtype=float)
        span = f"{number(float(x[-1] - x[0]), 3)} s" if trace.axis == "t_s" and len(x) else DASH
        rows.append(
            [escape(trace.name), "held out" if trace.role == "holdout" else "training", f"{len(trace.measured)}", span]
        )
    return table(["record", "role", "rows", "length"], rows, left=2)


def smallest_table(finding: Finding) -> str:
    """The smallest effect that would have been seen."""
    rows = [[effect_words(name), number(value, 3)] for name, value in sorted(finding.smallest_detectable.items())]
    return table(["effect", "smallest amplitude that would have been seen"], rows)


def time_table(finding: Finding) -> str:
    """Where the time went."""
    rows = [[escape(name.replace("_", " ")), f"{seconds:.1f} s"] for name, seconds in finding.timings.items()]
    return table(["step", "time"], [*rows, ["<b>all</b>", f"<b>{finding.seconds:.1f} s</b>"]])


def _interval_drawing(nominal: float | None, estimate: Estimate) -> str:
    """Change from nominal in per cent with its interval as a small drawing of -50 to +50 %."""
    if not nominal or not math.isfinite(nominal) or not math.isfinite(estimate.value):
        return DASH
    change, low, high = (100 * (v / nominal - 1) for v in (estimate.value, *estimate.ci95))
    low, high = min(low, high), max(low, high)
    x, a, b = (
        70 + 1.3 * min(max(v, -50.0), 50.0) if math.isfinite(v) else (5.0 if v < 0 else 135.0)
        for v in (change, low, high)
    )
    colour = "#0b7a84" if estimate.told else "#b9c2cc"
    drawing = (
        '<svg width="140" height="16" viewBox="0 0 140 16"><line x1="5" x2="135" y1="8" y2="8" stroke="#e6eaee"/>'
        '<line x1="70" x2="70" y1="1" y2="15" stroke="#8792a0"/>'
        f'<line x1="{a:.1f}" x2="{b:.1f}" y1="8" y2="8" stroke="{colour}" stroke-width="3"/>'
        f'<circle cx="{x:.1f}" cy="8" r="4" fill="{colour}"/></svg>'
    )
    return f'<span class="change">{change:+.1f} %</span>{drawing}'.replace(">-", ">−")


def _bar(value: float, limit: float) -> str:
    share = value / limit if limit and math.isfinite(value) and math.isfinite(limit) else math.nan
    if not math.isfinite(share) or share < 0:
        return ""
    width, colour = 60 * min(share, 2.0), "#b4492e" if share > 1 else "#0b7a84"
    return (
        '<svg width="124" height="12"><rect width="124" height="12" rx="3" fill="#eef1f4"/>'
        f'<rect width="{width:.1f}" height="12" rx="3" fill="{colour}"/>'
        '<line x1="60" x2="60" y1="0" y2="12" stroke="#1d2733"/></svg>'
    )
