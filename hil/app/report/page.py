"""The report as one self-contained HTML page."""

import re
from dataclasses import dataclass, field
from html import escape

from hil.app.quantities import number
from hil.app.report.cards import effect_card, findings_html, symbols_of, warning_html
from hil.app.report.dependence import curves_figure, dependence_html, surface_figure
from hil.app.report.document import document, heading
from hil.app.report.figure_map import agreement_figure, speed_map
from hil.app.report.figure_residuals import residual_figure
from hil.app.report.figure_summary import candidate_figure, error_figure
from hil.app.report.figure_traces import motion_figure, trace_figure
from hil.app.report.mathml import equations_html
from hil.app.report.panels import Panel, closer, panels
from hil.app.report.tables import (
    candidate_table,
    check_table,
    error_table,
    parameter_table,
    record_table,
    separations_table,
    smallest_table,
    time_table,
)
from hil.app.report.theme import figure_html
from hil.app.report.words import (
    error_story,
    headline,
    interpolation,
    listed,
    parameter_words,
    quantities_words,
    tidy,
)
from models.identification.finding import NEXT_CSV, NEXT_TOML, Finding
from models.rigs.kinds import KINDS

POINTS, MOST_PANELS = 50_000, 12  # of all lines of a figure, and its panels
_INDEXED = re.compile(r"\b([A-Za-z])_([A-Za-z])\b")
"""A letter with an index in a sentence."""
VERDICTS = {"named": "effect named", "none": "nothing missing", "unknown": "no verdict"}


@dataclass
class _Page:
    """Sections in their order; numbers the figures."""

    sections: list[tuple[str, str, str]] = field(default_factory=list)
    figures: int = 0

    def figure(self, figure: object) -> str:
        self.figures += 1
        return figure_html(figure, f"figure-{self.figures}")

    def add(self, key: str, title: str, content: str) -> None:
        if content:
            self.sections.append((key, title, content))


def report_html(finding: Finding) -> str:
    """The page: verdict first, then what to measure next, the error, the records, the residual, the candidates, the new
    model and how sure it is.
    """
    page = _Page()
    drawn = [panel for trace in finding.traces for panel in panels(finding, trace)]
    page.add("next", "Next experiment", _next(page, finding))
    page.add("error", "Error before and after", _errors(page, finding))
    title = "The effect" if len(finding.effects) == 1 else "The effects"
    page.add("effect", title, "".join(effect_card(effect, finding) for effect in finding.effects))
    page.add("sure", "How sure this is", _sure(finding))
    page.add("findings", "What the records show of themselves", findings_html(finding))
    page.add("records", "What was measured, what the model said", _records(page, finding, drawn))
    page.add("depends", "What is unknown, and what it depends on", _depends(page, finding))
    page.add("residual", "The residual over every signal", _residuals(page, finding, drawn))
    page.add("candidates", "Candidates and their evidence", _candidates(page, finding))
    page.add("model", "The new model", _model(finding))
    page.add("times", "Where the time went", time_table(finding) if finding.timings else "")
    return document(headline(finding), _hero(finding), page.sections)


def _hero(finding: Finding) -> str:
    train = sum(trace.role != "holdout" for trace in finding.traces)
    held = len(finding.traces) - train
    counts = f"{train} training, {held} held out" if finding.traces else ""
    chip = f'<p class="chip">{escape(VERDICTS.get(finding.verdict, finding.verdict))}</p>'
    return heading(
        f"Closed loop · {finding.kind.replace('_', ' ')} rig · {counts}",
        headline(finding),
        error_story(finding),
        finding.verdict,
        chip + warning_html(finding),
    )


def _last(finding: Finding) -> str:
    return "augmented" if finding.effects else "calibrated"


def _next(page: _Page, finding: Finding) -> str:
    """What to measure next, and the motion that is proposed."""
    if not finding.next_experiment:
        return ""
    said = f'<div class="next"><p>{escape(tidy(finding.next_experiment))}</p></div>'
    if finding.proposal is None:
        return said
    return (
        f"{said}{page.figure(motion_figure(finding.proposal))}{separations_table(finding.proposal)}"
        f"<p><code>{NEXT_CSV}</code>"
        f" holds this motion, <code>{NEXT_TOML}</code> the same as a reference: <code>capsule track</code>,"
        f" <code>sil</code> and <code>run</code> follow it with <code>--reference {NEXT_TOML}</code>.</p>"
    )


def _errors(page: _Page, finding: Finding) -> str:
    words = (
        f"<p>Measure: {escape(finding.measure)}, of {escape(quantities_words(finding))}. “Nominal” is what the rig file"
        " says, “calibrated” the same model with its numbers fitted, “augmented” the model with what was found."
        " Held-out records touch no fit, search or threshold.</p>"
    )
    said = interpolation(finding)
    figure = "" if said else page.figure(error_figure(finding))
    return words + (f"<p><b>{escape(said)}</b></p>" if said else "") + figure + error_table(finding)


def _records(page: _Page, finding: Finding, drawn: list[Panel]) -> str:
    last = _last(finding)
    out = [record_table(finding)]
    if KINDS[finding.kind].runs:
        out += [page.figure(f) for f in (speed_map(drawn, last), agreement_figure(drawn, last)) if f is not None]
        return "".join(out)
    shown = sorted(drawn, key=lambda panel: panel.role != "holdout")[:MOST_PANELS]
    points = max(400, POINTS // (6 * max(len(shown), 1)))
    for place, panel in enumerate(shown):
        figure = page.figure(trace_figure(panel, points))
        role = "held out" if panel.role == "holdout" else "training"
        title = f"{escape(panel.record)}: {escape(panel.quantity)} ({role})"
        first = place == 0 or panel.role == "holdout" or len(shown) <= 3
        if place == 0 and panel.dense:
            near = page.figure(trace_figure(closer(panel), points, residual=False))
            figure += f"<p>A closer look, where the calibrated model is worst:</p>{near}"
        out.append(f"<h3>{title}</h3>{figure}" if first else f"<details><summary>{title}</summary>{figure}</details>")
    if len(drawn) > len(shown):
        out.append(f"<p>{len(drawn) - len(shown)} further records are not drawn.</p>")
    return "".join(out)


def _residuals(page: _Page, finding: Finding, drawn: list[Panel]) -> str:
    before, after = ("calibrated", "augmented") if finding.effects else ("nominal", "calibrated")
    figure = residual_figure([panel for panel in drawn if {before, after} <= set(panel.predicted)], before, after)
    if figure is None:
        checks = ""
    else:
        checks = (
            "<p>Measured minus predicted over whatever it may depend on. Dots are samples, the line is their local"
            " mean, dotted for backward motion: where it leaves zero, the model lacks something that goes with this"
            " signal.</p>" + page.figure(figure)
        )
    return checks + (f"<h3>Checks against chance</h3>{check_table(finding)}" if finding.checks else "")


def _depends(page: _Page, finding: Finding) -> str:
    found = finding.dependence
    if found is None:
        return ""
    figures = (figure for figure in (curves_figure(found), surface_figure(found)) if figure is not None)
    return dependence_html(found, map(page.figure, figures))


def _candidates(page: _Page, finding: Finding) -> str:
    figure = candidate_figure(finding)
    if figure is None:
        return ""
    words = (
        "<p>Every effect of the catalogue that can act on such a rig was held against the residual (left); the best"
        " were fitted together with the base and judged on data left out (right). Evidence and gain are the natural"
        " logarithm of the factor by which the misfit on data left out falls.</p>"
    )
    return f"{words}{page.figure(figure)}<details><summary>All candidates</summary>{candidate_table(finding)}</details>"


def _model(finding: Finding) -> str:
    lines = finding.symbolic or finding.equations
    formulas = equations_html(lines, symbols_of(finding)) if lines else ""
    untold = [parameter_words(name) for name, estimate in finding.calibration.items() if not estimate.told]
    words = f"<p>The data cannot tell {escape(listed(untold))}.</p>" if untold else ""
    numbers = (
        f"<details><summary>The same with its numbers, SI units</summary>{equations_html(finding.equations)}</details>"
        if finding.symbolic and finding.equations
        else ""
    )
    return (
        formulas
        + numbers
        + (
            f"<h3>Calibrated parameters</h3>{parameter_table(finding.calibration, finding.nominal)}{words}"
            if finding.calibration
            else ""
        )
    )


def _sure(finding: Finding) -> str:
    told = (_INDEXED.sub(r"<i>\1</i><sub>\2</sub>", escape(tidy(statement))) for statement in finding.statements)
    statements = "".join(f"<li>{one}</li>" for one in told)
    out = f"<ul>{statements}</ul>" if statements else ""
    failed = sum(not check.ok for check in finding.checks)
    if finding.checks:
        number_of = number(len(finding.checks))
        passed = "all pass" if not failed else f"{failed} fail"
        out = f"<p>Of {number_of} checks {passed}; they stand below the residual.</p>{out}"
    if finding.smallest_detectable:
        out += (
            f"<details><summary>How small an effect would have been seen</summary>{smallest_table(finding)}</details>"
        )
    return out
