"""A found effect as a card: what it is, its equations, its numbers, the curves that refine it, and how sure it is."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import fields
from html import escape
from typing import Final

from hil.app.quantities import number, percent
from hil.app.report.mathml import equations_html
from hil.app.report.tables import parameter_table
from hil.app.report.words import effect_summary, effect_words, listed, sentence, tidy
from models.effects.effect import Effect, Signals
from models.effects.equation import ARGUMENTS, about_axis, equations_of
from models.identification.confidence_map import confidence_map
from models.identification.finding import Finding, FoundEffect

_MOST: Final = math.log(1000)
# places on a logarithmic axis, and what stands there
_MARKS: Final = ((0.0, "1"), (math.log(2), "1/2"), (math.log(10), "1/10"), (math.log(100), "1/100"), (_MOST, "1/1000"))


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


_SIGNALS: Final = frozenset({*(f.name for f in fields(Signals)), *ARGUMENTS})


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
