"""The report of a closed loop as one self-contained page: what its template needs."""

from dataclasses import replace
from typing import Any

from hil.report import words
from hil.report.builder import page
from hil.report.figure_residuals import (
    agreement_figure,
    curves_figure,
    dependence_words,
    residual_figure,
    speed_map,
    surface_figure,
)
from hil.report.figure_summary import candidate_figure, error_figure, profile_figure
from hil.report.figure_traces import Panel, closer, motion_figure, panels, trace_figure
from hil.report.mathml import equations_html, symbol_html
from hil.report.numbers import error_rows, parameters, smallest_rows
from hil.report.words import PARTS, TEXT, column_words
from models.effects.equation import equations_of, legend
from models.identification.confidence_map import confidence_map
from models.identification.finding import NEXT_CSV, NEXT_TOML, STAGES, Dependence, Finding, Fitted, FoundEffect
from models.identification.residual_term import law_of, numbers_of, points_of
from models.identification.verdict import WORSE
from models.rigs.kinds import KINDS
from models.words.quantities import measured_unit

POINTS, MOST_PANELS = 50_000, 12  # of all lines of a figure, and its panels


def report_html(finding: Finding) -> str:
    """The page: verdict first, then what is left, the error, the effects, what to measure next, how sure this is, the
    records, the residual, the candidates and the new model.
    """
    drawn = [panel for trace in finding.traces for panel in panels(finding, trace)]
    before, after = ("calibrated", "augmented") if finding.effects else ("nominal", "calibrated")
    lines = finding.symbolic or finding.equations
    report = {
        **_head(finding),
        "finding": finding,
        "motion": finding.proposal and motion_figure(finding.proposal),
        "next_csv": NEXT_CSV,
        "next_toml": NEXT_TOML,
        "quantities": [column_words(column)[0] for column in finding.columns],
        "interpolation": words.interpolation(finding),
        "errors": error_figure(finding),
        "stages": [*STAGES],
        "error_rows": error_rows(finding),
        "cards": [_card(effect, finding) for effect in finding.effects],
        "confidence_origin": confidence_map().origin,
        "smallest": smallest_rows(finding),
        "record_findings": [*words.grouped(finding.findings)],
        "part_words": PARTS,
        "disagreeing": [*map(words.disagreement_words, finding.disagreeing)],
        **_records(finding, drawn, after),
        **_depends(finding.dependence),
        "residual": residual_figure([p for p in drawn if {before, after} <= set(p.predicted)], before, after),
        "candidates": candidate_figure(finding),
        "equations": equations_html(lines) if lines else "",
        "legend": {symbol_html(symbol) or symbol: meaning for symbol, meaning in legend(lines).items()},
        "profiles": profile_figure(finding.profiles),
        "calibration": parameters(finding.calibration, finding.nominal),
        "vague": [name for name, estimate in finding.calibration.items() if not estimate.identifiable],
    }
    return page("report.html.j2", report=report)


def _head(finding: Finding) -> dict[str, Any]:
    """Headline and lead; a warning where the report allows no verdict or checks fail."""
    train = sum(trace.role != "holdout" for trace in finding.traces)
    failed = [check for check in finding.checks if not check.ok]
    doubts = [*finding.reasons] or [TEXT("doubt.check", check=check) for check in failed]
    doubts += [found.sentence for found in finding.findings if found.id == WORSE and found.sentence not in doubts]
    doubt = "failed" if failed else "unknown" if finding.verdict == "unknown" else "worse"
    return {
        "headline": words.headline(finding),
        "train": train,
        "held_out": len(finding.traces) - train,
        "lead": f"{words.error_words(finding)} {words.confidence_words(finding)}".strip(),
        "chip": TEXT(f"verdict.{finding.verdict}"),
        "failed": len(failed),
        "doubts": doubts,
        "doubt": TEXT(f"doubt.{doubt}", failed=len(failed), n=len(finding.checks)),
    }


def _card(effect: FoundEffect, finding: Finding) -> dict[str, Any]:
    """A found effect with its equations, its numbers, its curves and how sure it is."""
    declared = finding.effect(effect.id)
    own = {effect.id: effect.parameters, **effect.curves}
    return {
        "effect": effect,
        "separated": declared.separated_by if declared else "",
        "parts": [_part(name, estimates, finding) for name, estimates in own.items()],
    }


def _part(name: str, estimates: dict[str, Fitted], finding: Finding) -> dict[str, Any]:
    """An effect or an added curve of it: its equations with the symbols of what was fitted, and its numbers; what
    stayed at its default is a number in the equations.
    """
    effect = finding.effect(name)
    estimates = {key: replace(one, unit=measured_unit(one.unit, finding.unit)) for key, one in estimates.items()}
    if effect is None:
        return {"name": name, "summary": "", "equations": "", "parameters": parameters(estimates, symbols={})}
    fixed = {p.name: p.value for p in effect.parameters() if p.name not in estimates}
    formulas = equations_of(effect, fixed, turns=finding.unit == "N m")
    return {
        "name": name,
        "summary": effect.summary,
        "equations": equations_html([[formula] for formula in formulas]),
        "parameters": parameters(estimates, symbols=effect.letters()),
    }


def _records(finding: Finding, drawn: list[Panel], last: str) -> dict[str, Any]:
    """The figures of the records, held-out ones first, at most `MOST_PANELS` of them."""
    found: dict[str, Any] = {"maps": [], "shown": [], "left_out": 0}
    if KINDS[finding.kind].runs:
        return found | {"maps": [speed_map(drawn, last), agreement_figure(drawn, last)]}
    shown = sorted(drawn, key=lambda panel: panel.role != "holdout")[:MOST_PANELS]
    points = max(400, POINTS // (6 * max(len(shown), 1)))
    for number, panel in enumerate(shown):
        closely = number == 0 and panel.dense
        one = {
            "title": f"{panel.record}: {panel.quantity} ({PARTS.get(panel.role, PARTS['train'])})",
            "figure": trace_figure(panel, points),
            "near": trace_figure(closer(panel), points, residual=False) if closely else None,
            "opened": number == 0 or panel.role == "holdout" or len(shown) <= 3,
        }
        found["shown"].append(one)
    return found | {"left_out": len(drawn) - len(shown)}


def _depends(found: Dependence | None) -> dict[str, Any]:
    """What the residual of an `unknown` depends on, and the proposed term."""
    if found is None:
        return {}
    shown = {"dependence": dependence_words(found), "curves": curves_figure(found), "surface": surface_figure(found)}
    term = found.term
    if term is None:
        return shown
    numbers = numbers_of(term)
    letters = {name: letter for name, (letter, _) in numbers.items()}
    estimates = {name: estimate for name, (_, estimate) in numbers.items()}
    return shown | {
        "term": equations_html([[law_of(term)]]),
        "term_numbers": parameters(estimates, symbols=letters),
        "term_points": points_of(term),
    }
