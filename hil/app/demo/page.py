"""The demo's report: one self-contained page with every loop from residual and effect to prediction and tracking,
before and after.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

from plotly.offline import get_plotlyjs

from hil.app.demo.figures import improvement_figure, left_over_figure, mission_figure
from hil.app.demo.story import Mission, Story, Told
from hil.app.identify.close_loop import MODEL, REPORT
from hil.app.report import headline
from hil.app.report.figure_traces import trace_figure
from hil.app.report.page import STYLE
from hil.app.report.panels import panels
from hil.app.report.tables import parameter_table
from hil.app.report.theme import figure_html
from hil.app.report.words import (
    DASH,
    STAGE_WORDS,
    effect_words,
    error_scale,
    error_story,
    listed,
    number,
    scaled,
    tested_part,
)
from models.identification.finding import STAGES

POINTS: Final = 4000
Line = tuple[Story, Told]


def demo_html(lines: Sequence[Line], seconds: float) -> str:
    """The page for all stories, driven ones first and in full."""
    loops = [line for line in lines if line[1].missions]
    sections = [
        (
            "numbers",
            "Before and after",
            _table(lines) + _figure(improvement_figure(loops), "improvement") if loops else _table(lines),
        )
    ]
    sections += [(story.name, story.title[:1].upper() + story.title[1:], _loop(story, told)) for story, told in loops]
    links = "".join(f'<a href="#{key}">{escape(key)}</a>' for key, _, _ in sections)
    body = "".join(
        f'<section id="{key}"><h2>{escape(title)}</h2>{content}</section>' for key, title, content in sections
    )
    title = "Drive, record, find what the model lacks, drive again"
    story = " ".join(
        [
            *(_sentence(story, told) for story, told in loops),
            *(f"{story.title.capitalize()}: {told.caution}" for story, told in lines if told.caution),
        ]
    )
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{STYLE.read_text(encoding='utf-8')}</style><script>{get_plotlyjs()}</script></head>"
        f'<body><main><header class="named"><p class="eyebrow">Capsule demo · {len(lines)} stories · {seconds:.0f}'
        " s</p>"
        f'<h1>{title}</h1><p class="story">{escape(story)}</p></header><nav>{links}</nav>{body}</main></body></html>\n'
    )


def _sentence(story: Story, told: Told) -> str:
    """What a loop came to, in a sentence."""
    first, last = (
        f"{1e3 * told.missions[stage].numbers['tracking_rmse_m']:.3g} mm" for stage in (STAGES[0], _last(told))
    )
    names = listed(effect_words(effect.id) for effect in told.finding.effects) or "no effect"
    kept = listed(map(effect_words, told.hidden)) or "nothing"
    again = (
        f"tracking error {first} before, {last} with the {_last(told)} model"
        if _last(told) != STAGES[0]
        else "no model passed"
    )
    return f"{story.name.capitalize()} rig: kept from everyone was {kept}; named was {names}; {again}."


def _last(told: Told) -> str:
    """The last stage that the gate let in."""
    return [stage for stage in STAGES if stage in told.missions][-1]


def _table(lines: Sequence[Line]) -> str:
    heads = ("Story", "Error of", *(STAGE_WORDS[stage] for stage in STAGES), "noise floor", "Verdict", "Report")
    rows = []
    for story, told in lines:
        factor, unit = error_scale(told.finding)
        part = tested_part(told.finding)
        errors = (told.finding.error[part].get(stage) for stage in STAGES)
        cells = [f"{number(scaled(value, factor), 3)} {unit}" for value in (*errors, told.finding.noise_floor)]
        what = "prediction, held out" if part == "holdout" else "prediction, training"
        link = f'<a href="{story.name}/{REPORT}">report</a>'
        rows.append(
            _row([escape(story.title), what], cells, [escape(f"{headline(told.finding)} {told.caution}".strip()), link])
        )
        if told.missions:
            cells = [
                f"{1e3 * told.missions[stage].numbers['tracking_rmse_m']:.3g} mm" if stage in told.missions else DASH
                for stage in STAGES
            ]
            rows.append(
                _row(["&nbsp;&nbsp;the same run driven again", "tracking, rms"], [*cells, ""], [_gate(told), ""])
            )
    head = "".join(f'<th class="word">{h}</th>' if k in (0, 1, 6, 7) else f"<th>{h}</th>" for k, h in enumerate(heads))
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>'


def _row(first: Sequence[str], numbers: Sequence[str], last: Sequence[str]) -> str:
    words = ["".join(f'<td class="word">{cell}</td>' for cell in part) for part in (first, last)]
    return f"<tr>{words[0]}{''.join(f'<td>{cell}</td>' for cell in numbers)}{words[1]}</tr>"


def _gate(told: Told) -> str:
    return "; ".join(
        f'gate, {stage}: <span class="{"pass" if verdict.passed else "fail"}">{escape(verdict.sentence)}</span>'
        for stage, verdict in told.gate.items()
    )


def _loop(story: Story, told: Told) -> str:
    """A driven story from what was hidden to what came of it."""
    finding, key = told.finding, story.name
    held = next((trace for trace in finding.traces if trace.role == "holdout"), finding.traces[0])
    kept = listed(map(effect_words, told.hidden)) or "nothing"
    effects = "".join(
        f"<h3>{escape(effect_words(effect.id))}</h3>{parameter_table(effect.parameters)}" for effect in finding.effects
    )
    stages = ", ".join(f"{_tracked(mission)} with the {stage} model" for stage, mission in told.missions.items())
    parts = [
        (
            f"<p>Kept from controller, model and search: <b>{escape(kept)}</b>. The rig was driven over the bus under"
            " the nominal model; close-loop read the logs of those runs. The mission below was never among them.</p>"
        ),
        f"<h3>Residual</h3>{_figure(left_over_figure(finding), f'{key}-residual')}",
        f"<h3>Effect</h3><p>{escape(headline(finding))}</p>{effects}",
        f"<h3>Prediction, on a run that no fit has seen</h3><p>{escape(error_story(finding))}</p>",
        _figure(trace_figure(panels(finding, held)[0], POINTS), f"{key}-held-out"),
        f"<h3>Acceptance test</h3><p>{_gate(told)}</p>",
        (
            "<h3>The same run again</h3><p>Rms (largest) tracking error of the true path, under one seed:"
            f" {escape(stages)}.</p>"
        ),
        _figure(mission_figure(told.missions), f"{key}-mission"),
        (
            f'<p><a href="{key}/{REPORT}">Report of close-loop</a>, <a href="{key}/{MODEL}">model</a>; beside them the'
            " scenario and log of every run.</p>"
        ),
    ]
    return "".join(parts)


def _tracked(mission: Mission) -> str:
    rms, largest = (1e3 * mission.numbers[key] for key in ("tracking_rmse_m", "tracking_max_m"))
    stopped = mission.numbers["stopped_because"]
    return f"{rms:.3g} ({largest:.3g}) mm" + (f", stopped ({stopped})," if stopped else "")


def _figure(figure: object, name: str) -> str:
    return f'<div class="figure">{figure_html(figure, name)}</div>' if figure is not None else ""
