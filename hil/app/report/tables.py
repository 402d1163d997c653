"""Tables of the report: errors, parameters with their intervals, checks with their limits, candidates, records,
times.
"""

import math
from html import escape

import numpy as np

from hil.app.quantities import DASH, change, number, percent, quantity, scale, told, unit_words
from hil.app.report.document import table
from hil.app.report.mathml import symbol_html
from hil.app.report.words import effect_words, error_cells, interpolation, parameter_words, scaled
from models.identification.finding import STAGES, Estimate, Finding, Proposal

PARTS = {"train": "training", "holdout": "held out"}
_LOG = "log10_"


def error_table(finding: Finding) -> str:
    """Errors by part and stage, and how much of the nominal error is gone."""
    rows = []
    for part, words in PARTS.items():
        errors = finding.error.get(part, {})
        first, last = errors.get("nominal", math.nan), errors.get("augmented", math.nan)
        compared = first and math.isfinite(first) and math.isfinite(last)
        compared = compared and not (part == "train" and interpolation(finding))
        *shown, floor = error_cells(finding, part)
        rows.append([words, *shown, percent(1 - last / first) if compared else DASH, floor])
    return table(["error", *STAGES, "gone", "noise floor"], rows)


def separations_table(proposal: Proposal) -> str:
    """What a proposed record would tell apart, and how well the records so far do; nothing where it is to show effects
    only.
    """
    rows = []
    for one in proposal.separations:
        names = [escape(effect_words(one.effect)), escape(effect_words(one.rival))]
        best = f"{number(one.so_far, 2)} ({escape(one.best_record)})"
        rows.append([*names, number(one.standard_deviations, 2), best])
    if not rows:
        return ""
    head = ["effect", "rival", "expected separation, standard deviations", "best record so far"]
    return table(head, rows, left=2) + (
        "<p>In standard deviations of the noise. A difference as small as the catalogue's forms leave of other forms"
        " tells two effects no more than chance does, however many of these it is.</p>"
    )


def parameter_table(estimates: dict[str, Estimate], nominal: dict[str, float] | None = None) -> str:
    """Parameters with their 95 % intervals; against the nominal values where there are any. A logarithm is shown as
    what it is the logarithm of, one unit has one prefix in all rows.
    """
    shown = {name: _delogged(name, estimate) for name, estimate in estimates.items()}
    known = {name: value for name, value in (nominal or {}).items() if name in shown}
    believed = {name: 10**value if name.startswith(_LOG) else value for name, value in known.items()}
    sizes: dict[str, list[float]] = {}
    for name, estimate in shown.items():
        sizes.setdefault(estimate.unit, []).extend((estimate.value, believed.get(name, estimate.value)))
    units = {unit: scale(values, unit) for unit, values in sizes.items()}
    rows = []
    for name, estimate in shown.items():
        factor, unit = units[estimate.unit]
        low, high = (factor * end for end in estimate.ci95)
        words = told(factor * estimate.value, (low, high))
        cannot = '<span class="untold">the data cannot tell</span>'
        interval = f"{words.low} … {words.high}" if estimate.told else cannot
        before = believed.get(name)
        compared = [number(scaled(before, factor)), _interval_drawing(before, estimate)] if nominal is not None else []
        first = [symbol_html(name), escape(parameter_words(name)), unit_words(unit)]
        value = words.value if estimate.told else number(factor * estimate.value, 3)
        rows.append([*first, *compared[:1], value, interval, *compared[1:]])
    found = ["value", "95 % interval"]
    if nominal is not None:
        found = ["nominal", "calibrated", "95 % interval", "change from nominal"]
    head = ["", "parameter", "unit", *found]
    lettered = any(row[0] for row in rows)
    return table(head, rows, left=3) if lettered else table(head[1:], [row[1:] for row in rows], left=2)


def check_table(finding: Finding) -> str:
    """Checks of the residual with the limits that chance sets."""
    rows = []
    for check in finding.checks:
        mark = '<span class="pass">within</span>' if check.ok else '<span class="fail">beyond</span>'
        numbers = [number(check.value, 3), number(check.limit, 3), _bar(check.value, check.limit)]
        rows.append([escape(check.name), escape(check.meaning), *numbers, mark])
    return table(["check", "what it asks", "value", "limit by chance", "", ""], rows, left=2)


def candidate_table(finding: Finding) -> str:
    """All candidates of all rounds."""
    rows = [
        [escape(effect_words(row.id)), escape(row.note), str(row.round), percent(row.screened), number(row.gain, 3)]
        for row in finding.candidates
    ]
    return table(["candidate", "what became of it", "round", "screened", "gain"], rows, left=2)


def record_table(finding: Finding) -> str:
    """The records: name, role, samples, span."""
    rows = []
    for trace in finding.traces:
        x = np.asarray(trace.abscissa, dtype=float)
        span = f"{number(float(x[-1] - x[0]), 3)} s" if trace.axis == "t_s" and len(x) else DASH
        role = "held out" if trace.role == "holdout" else "training"
        rows.append([escape(trace.name), role, f"{len(trace.measured)}", span])
    return table(["record", "role", "rows", "length"], rows, left=2)


def smallest_table(finding: Finding) -> str:
    """The smallest effect that would have been seen."""
    rows = []
    for name, value in sorted(finding.smallest_detectable.items()):
        effect = finding.effect(name)
        amplitude = effect.amplitude() if effect else None
        unit = amplitude.unit if amplitude else ""
        words = parameter_words(amplitude.name) if amplitude else ""
        rows.append([escape(effect_words(name)), escape(words), quantity(value, unit)])
    return table(["effect", "its amplitude", "smallest that would have been seen"], rows, left=2)


def time_table(finding: Finding) -> str:
    """Where the time went."""
    rows = [[escape(name.replace("_", " ")), f"{seconds:.1f} s"] for name, seconds in finding.timings.items()]
    return table(["step", "time"], [*rows, ["<b>all</b>", f"<b>{finding.seconds:.1f} s</b>"]])


def _delogged(name: str, estimate: Estimate) -> Estimate:
    if not name.startswith(_LOG):
        return estimate
    low, high = (10**end for end in estimate.ci95)
    return Estimate(10**estimate.value, (low, high), estimate.unit.removeprefix("log10 "), estimate.told)


def _interval_drawing(nominal: float | None, estimate: Estimate) -> str:
    """Change from nominal with its interval as a small drawing of -50 to +50 %."""
    if not nominal or not math.isfinite(nominal) or not math.isfinite(estimate.value):
        return DASH
    off, low, high = (100 * (v / nominal - 1) for v in (estimate.value, *estimate.ci95))
    low, high = min(low, high), max(low, high)
    x, a, b = (
        70 + 1.3 * min(max(v, -50.0), 50.0) if math.isfinite(v) else (5.0 if v < 0 else 135.0) for v in (off, low, high)
    )
    kind = "own" if estimate.told else "untold"
    drawing = (
        '<svg width="140" height="16" viewBox="0 0 140 16"><line class="rule" x1="5" x2="135" y1="8" y2="8"/>'
        '<line class="mark" x1="70" x2="70" y1="1" y2="15"/>'
        f'<line class="{kind}" x1="{a:.1f}" x2="{b:.1f}" y1="8" y2="8" stroke-width="3"/>'
        f'<circle class="{kind}" cx="{x:.1f}" cy="8" r="4"/></svg>'
    )
    return f'<span class="change">{change(estimate.value, nominal)}</span>{drawing}'


def _bar(value: float, limit: float) -> str:
    share = value / limit if limit and math.isfinite(value) and math.isfinite(limit) else math.nan
    if not math.isfinite(share) or share < 0:
        return ""
    width, kind = 60 * min(share, 2.0), "over" if share > 1 else "own"
    return (
        '<svg width="124" height="12"><rect class="well" width="124" height="12" rx="3"/>'
        f'<rect class="{kind}" width="{width:.1f}" height="12" rx="3" stroke="none"/>'
        '<line class="mark" x1="60" x2="60" y1="0" y2="12"/></svg>'
    )
