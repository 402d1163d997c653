"""The report as one self-contained HTML page."""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from plotly.offline import get_plotlyjs

from hil.app.report.equations import equations_html
from hil.app.report.figure_map import agreement_figure, speed_map
from hil.app.report.figure_motion import motion_figure
from hil.app.report.figure_residuals import residual_figure
from hil.app.report.figure_summary import candidate_figure, error_figure
from hil.app.report.figure_traces import trace_figure
from hil.app.report.findings import findings_html, reasons_html
from hil.app.report.panels import Panel, closer, panels
from hil.app.report.tables import (
    candidate_table,
    check_table,
    error_table,
    parameter_table,
    record_table,
    smallest_table,
    time_table,
)
from hil.app.report.theme import figure_html
from hil.app.report.words import effect_summary, effect_words, error_story, headline, listed, number, quantities_words
from models.identification.finding import NEXT_CSV, NEXT_TOML, Finding, FoundEffect

STYLE = Path(__file__).with_name("style.css")
POINTS, MOST_PANELS = 50_000, 12
VERDICTS = {"named": "effect named", "none": "nothing missing", "unknown": "no verdict"}
OPENING = (
    "document.querySelectorAll('details').forEach(d => d.addEventListener('toggle', () => "
    "d.querySelectorAll('.js-plotly-plot').forEach(p => Plotly.Plots.resize(p))));"
)


@dataclass
class _Page:
    """Sections in their order; numbers the figures."""

    sections: list[tuple[str, str, str]] = field(default_factory=list)
    figures: int = 0

    def figure(self, figure: object) -> str:
        self.figures += 1
        return f'<div class="figure">{figure_html(figure, f"figure-{self.figures}")}</div>'

    def add(self, key: str, title: str, content: str) -> None:
        if content:
            self.sections.append((key, title, content))


def report_html(finding: Finding) -> str:
    """The page: verdict first, then the error, the records, the residual, the candidates, the new model and how sure it
    is.
    """
    page = _Page()
    drawn = [panel for trace in finding.traces for panel in panels(finding, trace)]
    page.add("findings", "What the records show of themselves", findings_html(finding))
    page.add("next", "Next experiment", _next(page, finding))
    page.add("error", "Error before and after", _errors(page, finding))
    page.add(
        "effect", "The effect" if len(finding.effects) == 1 else "The effects", "".join(map(_effect, finding.effects))
    )
    page.add("records", "What was measured, what the model said", _records(page, finding, drawn))
    page.add("residual", "The residual, and what it depends on", _residuals(page, finding, drawn))
    page.add("candidates", "Candidates and their evidence", _candidates(page, finding))
    page.add("model", "The new model", _model(finding))
    page.add("sure", "How sure this is", _sure(finding))
    page.add("times", "Where the time went", time_table(finding) if finding.timings else "")
    return _document(finding, page)


def _document(finding: Finding, page: _Page) -> str:
    links = "".join(f'<a href="#{key}">{title}</a>' for key, title, _ in page.sections)
    body = "".join(f'<section id="{key}"><h2>{title}</h2>{content}</section>' for key, title, content in page.sections)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(headline(finding))}</title><style>{STYLE.read_text(encoding='utf-8')}</style>"
        f"<script>{get_plotlyjs()}</script></head><body><main>{_hero(finding)}<nav>{links}</nav>{body}</main>"
        f"<script>{OPENING}</script></body></html>\n"
    )


def _hero(finding: Finding) -> str:
    train = sum(trace.role != "holdout" for trace in finding.traces)
    held = len(finding.traces) - train
    counts = f"{train} training, {held} held out" if finding.traces else ""
    return (
        f'<header class="{escape(finding.verdict)}">'
        f'<p class="eyebrow">Closed loop · {escape(finding.kind.replace("_", " "))} rig · {counts}</p>'
        f'<h1>{escape(headline(finding))}</h1><p class="story">{escape(error_story(finding))}</p>'
        f'<p class="chip">{escape(VERDICTS.get(finding.verdict, finding.verdict))}</p>{reasons_html(finding)}</header>'
    )


def _last(finding: Finding) -> str:
    return "augmented" if finding.effects else "calibrated"


def _next(page: _Page, finding: Finding) -> str:
    """What to measure next, and the motion that is proposed."""
    if not finding.next_experiment:
        return ""
    said = f'<div class="next"><p>{escape(finding.next_experiment)}.</p></div>'
    if finding.proposal is None:
        return said
    rows = "".join(
        f"<tr><td>{escape(effect_words(one.effect))}</td><td>{escape(effect_words(one.rival))}</td>"
        f"<td>{number(one.standard_deviations, 2)}</td>"
        f"<td>{number(one.so_far, 2)} ({escape(one.best_record)})</td></tr>"
        for one in finding.proposal.separations
    )
    return (
        f"{said}{page.figure(motion_figure(finding.proposal))}<table><thead><tr><th>effect</th><th>rival</th>"
        "<th>expected separation, standard deviations</th><th>best record so far</th></tr></thead>"
        f"<tbody>{rows}</tbody></table><p><code>{NEXT_CSV}</code> holds this motion, <code>{NEXT_TOML}</code> the same"
        " as a reference: <code>capsule track</code>, <code>sil</code> and <code>run</code> follow it with"
        f" <code>--reference {NEXT_TOML}</code>.</p>"
    )


def _errors(page: _Page, finding: Finding) -> str:
    words = (
        f"<p>Measure: {escape(finding.measure)}, of {escape(quantities_words(finding))}. “Nominal” is what the rig file"
        " says, “calibrated” the same model with its numbers fitted, “augmented” the model with what was found."
        " Held-out records touch no fit, search or threshold.</p>"
    )
    return words + page.figure(error_figure(finding)) + error_table(finding)


def _effect(effect: FoundEffect) -> str:
    summary, separated = effect_summary(effect.id)
    alike = (
        f"<p>These data cannot tell it from <b>{escape(listed(map(effect_words, effect.equivalent)))}</b>.</p>"
        if effect.equivalent
        else ""
    )
    apart = f"<p>What tells it from its confounded effects: {escape(separated)}.</p>" if separated else ""
    facts = {"evidence": number(effect.evidence, 3), "confidence": _confidence(effect.confidence)}
    return (
        f'<div class="card"><h3>{escape(effect_words(effect.id))} <code>{escape(effect.id)}</code></h3>'
        f"<p>{escape(summary[:1].upper() + summary[1:])}.</p>"
        f'<div class="facts">{"".join(f"<div><b>{value}</b>{name}</div>" for name, value in facts.items())}</div>'
        f"{parameter_table(effect.parameters)}{alike}{apart}</div>"
    )


def _confidence(share: float) -> str:
    return f"{100 * share:.0f} %" if share < 0.995 else f"{100 * share:.1f} %"


def _records(page: _Page, finding: Finding, drawn: list[Panel]) -> str:
    last = _last(finding)
    out = [record_table(finding)]
    if finding.kind == "vibro_table":
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


def _candidates(page: _Page, finding: Finding) -> str:
    figure = candidate_figure(finding)
    if figure is None:
        return ""
    words = (
        "<p>Every effect of the catalogue that can act on such a rig was held against the residual (left); the best"
        " were fitted together with the base and judged on data left out (right).</p>"
    )
    return f"{words}{page.figure(figure)}<details><summary>All candidates</summary>{candidate_table(finding)}</details>"


def _model(finding: Finding) -> str:
    formulas = equations_html(finding.equations) if finding.equations else ""
    untold = [name for name, estimate in finding.calibration.items() if not estimate.told]
    words = f"<p>The data cannot tell {escape(listed(untold))}.</p>" if untold else ""
    return formulas + (
        f"<h3>Calibrated parameters</h3>{parameter_table(finding.calibration, finding.nominal)}{words}"
        if finding.calibration
        else ""
    )


def _sure(finding: Finding) -> str:
    statements = "".join(f"<li>{escape(statement)}</li>" for statement in finding.statements)
    out = f"<ul>{statements}</ul>" if statements else ""
    if finding.smallest_detectable:
        out += (
            f"<details><summary>How small an effect would have been seen</summary>{smallest_table(finding)}</details>"
        )
    return out
