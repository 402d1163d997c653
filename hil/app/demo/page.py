"""The demo's report: one self-contained page; for every loop residual, effect, prediction and tracking."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from hil.app.close_loop import MODEL, REPORT
from hil.app.demo.example import BEFORE, TEXT, End, Example, ExampleResult, Learned, Mission, title_of
from hil.app.sil.learning_page import PAGE as LEARNED
from hil.app.sil.learning_page import error_figure
from hil.report.builder import page
from hil.report.figure_residuals import residual_figure
from hil.report.figure_summary import stage_bar
from hil.report.figure_traces import motion_figure, panels, trace_figure
from hil.report.numbers import parameters
from hil.report.theme import MUTED, POINTS, STAGE_COLOURS, axes, line, styled
from hil.report.words import (
    column_words,
    confidence_words,
    error_cells,
    error_scale,
    error_words,
    headline,
    parameter_words,
    tested_part,
    verdict_words,
)  # fmt: skip
from models.effects import CATALOGUE, effect_words
from models.identification.finding import NEXT_TOML, STAGES, Finding
from models.words.quantities import DASH, quantity, scale, unit_words
from models.words.sentences import listed

SIGNALS: Final = ("x_m", "v_m_s")
HEADROOM: Final = 1.15  # above the highest bar
_MEASURED: Final = 3  # panels of a printed measurement
Line = tuple[Example, ExampleResult]


def demo_html(ends: Sequence[tuple[Example, End]], seconds: float) -> str:
    """The page for all examples, driven ones first and in full, then those that learned while they ran."""
    lines = [(example, one) for example, one in ends if isinstance(one, ExampleResult)]
    loops = [line for line in lines if line[1].missions]
    return page(
        "demo.html.j2",
        lines=[_line(example, one) for example, one in lines],
        learned=[
            {**_head(example), "result": one, "error": error_figure(one.numbers)}
            for example, one in ends
            if isinstance(one, Learned)
        ],
        stories=[(example.name, *story_row(example, one)) for example, one in ends],
        seconds=seconds,
        improvement=improvement_figure(loops) if loops else None,
        stages=[*STAGES],
        files={"report": REPORT, "model": MODEL, "before": BEFORE, "next": NEXT_TOML, "learned": LEARNED},
    )


def _head(example: Example) -> dict[str, str]:
    title = title_of(example)
    return {"name": example.name, "title": title[:1].upper() + title[1:]}


def _line(example: Example, one: ExampleResult) -> dict[str, Any]:
    """An example's numbers in words, and its figures: the missions of a driven one, the motion of a proposed record."""
    finding, shown = one.finding, {**_head(example), "result": one, "error_words": error_words(one.finding)}
    shown["headline"] = f"{headline(finding)} {confidence_words(finding)}".strip()
    shown["verdict"] = verdict_words(finding)
    if not one.missions and one.before is None:
        drawn = [panel for trace in finding.traces for panel in panels(finding, trace)][:_MEASURED]
        return shown | {"measured": [(f"{one.record}: {one.quantity}", trace_figure(one, POINTS)) for one in drawn]}
    held = next((trace for trace in finding.traces if trace.role == "holdout"), finding.traces[0])
    shown |= {"truth": truth_rows(one), "held": trace_figure(panels(finding, held)[0], POINTS)}
    if one.before is not None:
        proposal = one.before.proposal
        shown |= {"motion": proposal and motion_figure(proposal), "before": headline(one.before)}
        return shown | {"first_verdict": verdict_words(one.before)}
    driven = [stage for stage in STAGES if stage in one.missions]
    shown |= {"tracked": {stage: mission.numbers for stage, mission in one.missions.items()}, "last": driven[-1]}
    return shown | {"residual": residuals_figure(finding), "mission": mission_figure(one.missions)}


def truth_rows(one: ExampleResult) -> list[list[str]]:
    rows: dict[tuple[str, str], list[str]] = {}
    for name, numbers in one.truth.items():
        for key, value in numbers.items():
            truth = quantity(value, column_words(key)[1]) if isinstance(value, int | float) else str(value)
            words = effect_words(name), parameter_words(key)
            rows[words] = [*words, truth, DASH, DASH]
    for effect in one.finding.effects:
        for row in parameters(effect.parameters)["rows"]:
            words, unit = (effect_words(effect.id), parameter_words(row["name"])), unit_words(row["unit"])
            found = rows.setdefault(words, [*words, DASH, DASH, DASH])
            found[3] = f"{row['value']} {unit}".rstrip()
            interval = f"{row['low']} … {row['high']} {unit}".rstrip()
            found[4] = interval if row["identifiable"] else "not identifiable"
    return [*rows.values()]


def improvement_figure(loops: Sequence[Line]) -> go.Figure:
    shown: list[tuple[str, dict[str, float]]] = []
    for example, one in loops:
        factor, unit = error_scale(one.finding)
        errors = one.finding.error[tested_part(one.finding)]
        scaled = {stage: factor * errors[stage] for stage in STAGES if stage in errors}
        shown.append((f"{example.name}: prediction error in {unit}", scaled))
        rms = {stage: mission.numbers["tracking_rmse_m"] for stage, mission in one.missions.items()}
        factor, unit = scale(rms.values(), "m")
        scaled = {stage: factor * error for stage, error in rms.items()}
        shown.append((f"{example.name}: tracking error in {unit}", scaled))
    figure = make_subplots(rows=1, cols=len(shown), horizontal_spacing=0.09)
    for column, (title, errors) in enumerate(shown, start=1):
        for stage, value in errors.items():
            here = {"x": [stage], "showlegend": column == 1, "row": 1, "col": column}
            figure.add_bar(y=[value], **here, **stage_bar(stage, [value]))
        top = HEADROOM * max(errors.values(), default=1.0)
        figure.update_yaxes(range=[0, top], title=title, row=1, col=column)
    styled(figure, 340, bargap=0.35).update_layout(legend={"y": -0.04, "yanchor": "top"})
    return figure.update_xaxes(showticklabels=False)


def residuals_figure(finding: Finding) -> go.Figure | None:
    before, after = ("calibrated", "augmented") if finding.effects else ("nominal", "calibrated")
    drawn = [panel for trace in finding.traces for panel in panels(finding, trace)]
    kept = [replace(p, signals={name: values for name, values in p.signals.items() if name in SIGNALS}) for p in drawn]
    return residual_figure([panel for panel in kept if {before, after} <= set(panel.predicted)], before, after)


def mission_figure(missions: Mapping[str, Mission]) -> go.Figure:
    figure = axes("time in s", ("position in mm", "error in mm"), 560)
    first = next(iter(missions.values()))
    line(figure, first.time_s, 1e3 * first.reference_m, "reference", {"color": MUTED, "width": 3.0}, points=3000)
    for stage, mission in missions.items():
        for row, metres in ((1, mission.position_m), (2, mission.position_m - mission.reference_m)):
            look = {"color": STAGE_COLOURS[stage], "width": 1.6}
            line(figure, mission.time_s, 1e3 * metres, stage, look, row, points=3000)
    return figure


_SHOWN: Final = 2  # numbers of an effect: its amplitude and, of the plant's and the model's, one that both have


def story_row(example: Example, one: End) -> list[str]:
    """Title, hidden, found, size of both, and error of the prediction and of the tracking, before and after."""
    if isinstance(one, Learned):
        found, sizes, prediction = [*one.learnt], _learnt(one), DASH
        rms_m = [part["rms_error_m"] for part in one.numbers["parts"] if part["rms_error_m"] is not None][-2:]
    else:
        found, sizes = [effect.id for effect in one.finding.effects], _found(one)
        cells = dict(zip(STAGES, error_cells(one.finding, tested_part(one.finding)), strict=False))
        prediction = _change(cells[STAGES[0]], cells["augmented" if found else "calibrated"])
        rms_m = [run.numbers["tracking_rmse_m"] for run in one.missions.values()]
    tracking = _change(quantity(rms_m[0], "m"), quantity(rms_m[-1], "m")) if rms_m else DASH
    effects = listed(map(effect_words, one.truth)) or TEXT("row.measured"), listed(map(effect_words, found))
    row = [_head(example)["title"], effects[0], effects[1] or TEXT("row.nothing")]
    return [*row, _sizes(one.truth) or DASH, sizes or DASH, prediction, tracking]


def _sizes(effects: Mapping[str, Mapping[str, Any]]) -> str:
    return ", ".join(
        f"{parameter_words(key)} {quantity(value, column_words(key)[1])}"
        for numbers in effects.values()
        for key, value in list(numbers.items())[:_SHOWN]
    )


def _shown(effect: str, names: Iterable[str], truth: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """The effect's amplitude, and what the plant's effect of this name has too among the numbers that are shown."""
    first, *others = names
    return [first, *(name for name in others if name in list(truth.get(effect, {}))[:_SHOWN])]


def _found(one: ExampleResult) -> str:
    said = []
    for effect in one.finding.effects:
        shown = _shown(effect.id, effect.parameters, one.truth)
        for row in parameters({name: effect.parameters[name] for name in shown})["rows"]:
            unit = unit_words(row["unit"])
            interval = f" ({row['low']} … {row['high']})" if row["identifiable"] else ""
            said.append(f"{parameter_words(row['name'])} {row['value']}{interval} {unit}".rstrip())
    return ", ".join(said)


def _learnt(one: Learned) -> str:
    units = {name: {p.name: p.unit for p in CATALOGUE[name].parameters()} for name in one.learnt}
    return ", ".join(
        f"{parameter_words(key)} {quantity(numbers[key], units[name][key])}"
        for name, numbers in one.learnt.items()
        for key in _shown(name, numbers, one.truth)
    )


def _change(before: str, after: str) -> str:
    return TEXT("row.change", before=before, after=after)
