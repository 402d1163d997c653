"""Cards: a found effect with its equations, its numbers, its curves and how sure it is; what the records show of
themselves.
"""

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import fields
from html import escape
from typing import Final

from hil.app.quantities import number, percent
from hil.app.report.mathml import equations_html
from hil.app.report.tables import parameter_table
from hil.app.report.words import effect_summary, effect_words, listed, sentence, tidy
from models.checks.finding import RecordFinding
from models.effects.effect import Effect, Signals
from models.effects.equation import ARGUMENTS, about_axis, equations_of
from models.identification.confidence_map import confidence_map
from models.identification.finding import Finding, FoundEffect
from models.identification.verdict import WORSE

_MOST: Final = math.log(1000)
# places on a logarithmic axis, and what stands there
_MARKS: Final = ((0.0, "1"), (math.log(2), "1/2"), (math.log(10), "1/10"), (math.log(100), "1/100"), (_MOST, "1/1000"))


_SIGNALS: Final = frozenset({*(f.name for f in fields(Signals)), *ARGUMENTS})
SEVERITIES = {"stops": "stops a fit", "weakens": "weakens the verdict", "note": "note"}


def effect_card(effect: FoundEffect, finding: Finding) -> str:
    """The card of one effect of a finding."""
    summary, separated = effect_summary(effect.id)
    alike = (
        f"<p>These data cannot tell it from <b>{escape(listed(map(effect_words, effect.equivalent)))}</b>.</p>"
        if effect.equivalent
        else ""
    )
    apart = f"<p>What tells it from effects that act alike: {escape(tidy(separated))}.</p>" if separated else ""
    curves = "".join(
        f"<h3>Added curve: {escape(effect_words(name))}</h3><p>{escape(sentence(effect_summary(name)[0]))}</p>"
        f"{_equations(name, parameters, finding)}{parameter_table(parameters)}"
        for name, parameters in effect.curves.items()
    )
    return (
        f'<div class="card"><h3>{escape(effect_words(effect.id))} <code>{escape(effect.id)}</code></h3>'
        f"<p>{escape(sentence(summary))}</p>{_equations(effect.id, effect.parameters, finding)}"
        f"{parameter_table(effect.parameters)}{curves}"
        f"{_scale(effect)}{_confidence(effect, finding)}{alike}{apart}</div>"
    )


def symbols_of(finding: Finding) -> set[str]:
    """Names in a finding's equations that are symbols and no words."""
    effects = [name for effect in finding.effects for name in (effect.id, *effect.curves)]
    known = [effect for effect in map(finding.effect, effects) if effect is not None]
    parameters = [p.name for effect in known for p in effect.parameters()]
    return {*finding.calibration, *finding.nominal, *parameters, *_SIGNALS, *_states(known)}


def _states(effects: Sequence[type[Effect]]) -> set[str]:
    states = {state for effect in effects for state in effect.states}
    return states | {f"{state}_state" for state in states}


def _equations(name: str, fitted: Collection[str], finding: Finding) -> str:
    """The equations of an effect with the symbols of what was fitted; what stayed at its default is a number."""
    effect = finding.effect(name)
    if effect is None:
        return ""
    fixed = {p.name: p.value for p in effect.parameters() if p.name not in fitted}
    symbols = {*(p.name for p in effect.parameters()), *_SIGNALS, *_states([effect])}
    lines = [str(equation) for equation in equations_of(effect, fixed, 4)]
    return equations_html([about_axis(line) for line in lines] if finding.unit == "N m" else lines, symbols)


def _scale(effect: FoundEffect) -> str:
    """The evidence on a line from no gain to a thousandth of the misfit."""
    left = math.exp(-max(effect.evidence, 0.0))
    width, x = 500.0, 500.0 * min(max(effect.evidence, 0.0), _MOST) / _MOST
    marks = "".join(
        f'<line class="mark" x1="{width * at / _MOST:.1f}" x2="{width * at / _MOST:.1f}" y1="8" y2="18"/>'
        f'<text x="{width * at / _MOST:.1f}" y="32" text-anchor="{_anchor(at)}">{words}</text>'
        for at, words in _MARKS
    )
    remains = number(left, 2) if left >= 1e-4 else "less than 0.0001"
    return (
        f'<div class="scale"><b>Evidence {number(effect.evidence, 3)}</b>: on data left out of its fits the misfit'
        f" falls to {remains} of what it was. From nothing gained (1) to a thousandth left:"
        f'<svg viewBox="-10 0 520 36" role="img" aria-label="evidence {number(effect.evidence, 3)}">'
        f'<line class="rule" x1="0" x2="{width}" y1="13" y2="13" stroke-width="4"/>'
        f'<line class="own" x1="0" x2="{x:.1f}" y1="13" y2="13" stroke-width="4"/>'
        f'<circle class="own" cx="{x:.1f}" cy="13" r="6"/>{marks}</svg></div>'
    )


def _anchor(at: float) -> str:
    return "start" if at == 0 else "end" if at >= _MOST else "middle"


def _confidence(effect: FoundEffect, finding: Finding) -> str:
    """What the confidence is worth: never more than the series tell that its map rests on."""
    said = percent(effect.confidence) if effect.calibrated else "not calibrated"
    what = "it or one of those that act alike" if effect.equivalent else "it and no other effect of the catalogue"
    doubt = " Checks of this report fail, so it may be less." if any(not check.ok for check in finding.checks) else ""
    meaning = f"{escape(effect.meaning)} {escape(confidence_map().origin)}" if effect.meaning else ""
    return f'<div class="facts"><div><b>{said}</b>confidence that it is {what}. {meaning}{doubt}</div></div>'


def grouped(findings: Sequence[RecordFinding]) -> Iterator[list[RecordFinding]]:
    """Findings of one id and severity together, in their order."""
    for name, severity in dict.fromkeys((finding.id, finding.severity) for finding in findings):
        yield [finding for finding in findings if (finding.id, finding.severity) == (name, severity)]


def findings_html(finding: Finding) -> str:
    """Findings as cards, each with its records, how it was told and the remedy; then what the records cannot show."""
    cards = "".join(map(_card, grouped(finding.findings)))
    hidden = "".join(
        f"<li>{escape(listed(effect_words(name) for name, said in finding.cannot_show.items() if said == why))}:"
        f" {escape(why)}</li>"
        for why in dict.fromkeys(finding.cannot_show.values())
    )
    return cards + (f"<h3>These records cannot show</h3><ul>{hidden}</ul>" if hidden else "")


def warning_html(finding: Finding) -> str:
    """What keeps the report from a verdict, or checks that fail: a warning on top; empty where there is none."""
    failed = [
        f"{check.name}: {number(check.value, 3)}, at most {number(check.limit, 3)} allowed ({check.meaning})"
        for check in finding.checks
        if not check.ok
    ]
    said = [*finding.reasons] or failed
    said += [found.sentence for found in finding.findings if found.id == WORSE and found.sentence not in said]
    if not said:
        return ""
    no_verdict = "The records allow no verdict" if finding.verdict == "unknown" else "A stage of the model is worse"
    some = f"{len(failed)} of {len(finding.checks)} checks fail" if failed else no_verdict
    rows = "".join(f"<li>{escape(tidy(reason))}</li>" for reason in said)
    return f'<div class="warning" role="note"><p>{some}: do not rely on this model yet.</p><ul>{rows}</ul></div>'


def _card(alike: Sequence[RecordFinding]) -> str:
    first = alike[0]
    places = "".join(f"<li><b>{escape(f.file)}</b>, {escape(f.where)}: {escape(tidy(f.sentence))}</li>" for f in alike)
    return (
        f'<div class="card {first.severity}"><h3>{escape(first.id.replace("_", " "))}'
        f" <small>{SEVERITIES[first.severity]}</small></h3><ul>{places}</ul>"
        f"<p>Told by: {escape(first.how)}.</p><p>Remedy: <code>{escape(first.remedy)}</code></p></div>"
    )
