"""The report of a closed loop as one self-contained page: what its template needs."""

import math
from collections.abc import Collection
from typing import Any, Final

import numpy as np
from markupsafe import Markup

from hil.report.builder import page
from hil.report.dependence import curves_figure, story, surface_figure
from hil.report.figure_map import agreement_figure, speed_map
from hil.report.figure_residuals import residual_figure
from hil.report.figure_summary import candidate_figure, error_figure
from hil.report.figure_traces import motion_figure, trace_figure
from hil.report.mathml import equations_html
from hil.report.panels import Panel, closer, panels
from hil.report.tables import error_rows, limit_share, parameters, record_rows, smallest_rows
from hil.report.words import PARTS, effect_summary, error_story, grouped, headline, interpolation, quantities_words
from models.effects.effect import Effect
from models.effects.equation import equations_of
from models.identification.confidence_map import confidence_map
from models.identification.finding import NEXT_CSV, NEXT_TOML, STAGES, Dependence, Finding, Fitted, FoundEffect
from models.identification.residual_term import law_of
from models.identification.verdict import WORSE
from models.rigs.kinds import KINDS
from models.words.quantities import number

POINTS, MOST_PANELS = 50_000, 12  # of all lines of a figure, and its panels
VERDICTS: Final = {"named": "effect named", "none": "nothing missing", "unknown": "no verdict"}
SEVERITIES: Final = {"stops": "stops a fit", "weakens": "weakens the verdict", "note": "note"}
_MOST: Final = math.log(1000)
_MARKS: Final = ((0.0, "1"), (math.log(2), "1/2"), (math.log(10), "1/10"), (math.log(100), "1/100"), (_MOST, "1/1000"))
"""Places on a logarithmic axis, and what stands there."""


def report_html(finding: Finding) -> str:
    """The page: verdict first, then what to measure next, the error, the records, the residual, the candidates, the new
    model and how sure it is.
    """
    drawn = [panel for trace in finding.traces for panel in panels(finding, trace)]
    before, after = ("calibrated", "augmented") if finding.effects else ("nominal", "calibrated")
    report = {
        **_head(finding),
        "finding": finding,
        "motion": finding.proposal and motion_figure(finding.proposal),
        "next_csv": NEXT_CSV,
        "next_toml": NEXT_TOML,
        "quantities": quantities_words(finding),
        "interpolation": interpolation(finding),
        "errors": error_figure(finding),
        "stages": [*STAGES],
        "error_rows": error_rows(finding),
        "cards": [_card(effect, finding) for effect in finding.effects],
        "confidence_origin": confidence_map().origin,
        "smallest": smallest_rows(finding),
        "record_findings": [*grouped(finding.findings)],
        "severities": SEVERITIES,
        "cannot_show": _by_reason(finding.cannot_show),
        **_records(finding, drawn, after),
        **_depends(finding.dependence),
        "residual": residual_figure([p for p in drawn if {before, after} <= set(p.predicted)], before, after),
        "checks": [{"check": check, "share": limit_share(check)} for check in finding.checks],
        "candidates": candidate_figure(finding),
        "equations": equations_html(finding.symbolic or finding.equations) if finding.equations else "",
        "calibration": parameters(finding.calibration, finding.nominal),
        "vague": [name for name, estimate in finding.calibration.items() if not estimate.identifiable],
    }
    return page("report.html.j2", report=report)


def _head(finding: Finding) -> dict[str, Any]:
    """Headline and story; what keeps the report from a verdict, or checks that fail, as a warning."""
    train = sum(trace.role != "holdout" for trace in finding.traces)
    counts = f"{train} training, {len(finding.traces) - train} held out" if finding.traces else ""
    failed = [
        f"{check.name}: {number(check.value, 3)}, at most {number(check.limit, 3)} allowed ({check.meaning})"
        for check in finding.checks
        if not check.ok
    ]
    doubts = [*finding.reasons] or [*failed]
    doubts += [found.sentence for found in finding.findings if found.id == WORSE and found.sentence not in doubts]
    no_verdict = "The records allow no verdict" if finding.verdict == "unknown" else "A stage of the model is worse"
    return {
        "headline": headline(finding),
        "eyebrow": f"Closed loop · {finding.kind.replace('_', ' ')} rig · {counts}",
        "story": error_story(finding),
        "chip": VERDICTS.get(finding.verdict, finding.verdict),
        "failed": len(failed),
        "doubts": doubts,
        "doubt": f"{len(failed)} of {len(finding.checks)} checks fail" if failed else no_verdict,
    }


def _card(effect: FoundEffect, finding: Finding) -> dict[str, Any]:
    """A found effect with its equations, its numbers, its curves and how sure it is."""
    evidence = max(effect.evidence, 0.0)
    left = math.exp(-evidence)
    marks = [(f"{500 * at / _MOST:.1f}", words) for at, words in _MARKS]
    return {
        "effect": effect,
        "separated": effect_summary(effect.id)[1],
        "parts": [_part(effect.id, effect.parameters, finding)]
        + [_part(name, estimates, finding) for name, estimates in effect.curves.items()],
        "remains": number(left, 2) if left >= 1e-4 else "less than 0.0001",
        "x": f"{500 * min(evidence, _MOST) / _MOST:.1f}",
        "marks": marks,
    }


def _part(name: str, estimates: dict[str, Fitted], finding: Finding) -> dict[str, Any]:
    """What an effect or an added curve of it is: its equations, and its numbers."""
    effect = finding.effect(name)
    return {
        "name": name,
        "summary": effect_summary(name)[0],
        "equations": _equations(effect, estimates, finding),
        "parameters": parameters(estimates, symbols=effect.symbols if effect else {}),
    }


def _equations(effect: type[Effect] | None, fitted: Collection[str], finding: Finding) -> Markup:
    """The equations of an effect with the symbols of what was fitted; what stayed at its default is a number."""
    if effect is None:
        return Markup("")
    fixed = {p.name: p.value for p in effect.parameters() if p.name not in fitted}
    return equations_html([[formula] for formula in equations_of(effect, fixed, turns=finding.unit == "N m")])


def _by_reason(cannot_show: dict[str, str]) -> dict[str, list[str]]:
    reasons: dict[str, list[str]] = {}
    for name, why in cannot_show.items():
        reasons.setdefault(why, []).append(name)
    return reasons


def _records(finding: Finding, drawn: list[Panel], last: str) -> dict[str, Any]:
    """The records and what is drawn of them: held-out ones first, and not all of many."""
    found: dict[str, Any] = {"record_rows": record_rows(finding), "maps": [], "shown": [], "left_out": 0}
    if KINDS[finding.kind].runs:
        return found | {"maps": [speed_map(drawn, last), agreement_figure(drawn, last)]}
    shown = sorted(drawn, key=lambda panel: panel.role != "holdout")[:MOST_PANELS]
    points = max(400, POINTS // (6 * max(len(shown), 1)))
    for place, panel in enumerate(shown):
        closely = place == 0 and panel.dense
        one = {
            "title": f"{panel.record}: {panel.quantity} ({PARTS.get(panel.role, PARTS['train'])})",
            "figure": trace_figure(panel, points),
            "near": trace_figure(closer(panel), points, residual=False) if closely else None,
            "opened": place == 0 or panel.role == "holdout" or len(shown) <= 3,
        }
        found["shown"].append(one)
    return found | {"left_out": len(drawn) - len(shown)}


def _depends(found: Dependence | None) -> dict[str, Any]:
    """What the residual of an `unknown` depends on, and the term that is proposed for it."""
    if found is None:
        return {}
    shown = {"dependence": story(found), "curves": curves_figure(found), "surface": surface_figure(found)}
    term = found.term
    if term is None:
        return shown
    return shown | {
        "term": equations_html([[law_of(term)]]),
        "term_numbers": {"amplitude": term.amplitude, **term.numbers},
        "term_given": {name: np.atleast_1d(value).tolist() for name, value in term.given.items()},
    }
