"""The demo's figures: both errors by stage, the residual before and after, and the mission driven with each
model.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from hil.app.demo.story import Array, Mission, Story, Told
from hil.app.quantities import scale
from hil.app.report.figure_residuals import residual_figure
from hil.app.report.figure_summary import stage_bar
from hil.app.report.panels import panels, thinned
from hil.app.report.theme import MUTED, STAGE_COLOURS, styled
from hil.app.report.words import error_scale, tested_part
from models.identification.finding import STAGES, Finding

SIGNALS: Final = ("x_m", "v_m_s")
POINTS: Final = 3000  # of a line
HEADROOM: Final = 1.15  # above the highest bar


def improvement_figure(loops: Sequence[tuple[Story, Told]]) -> go.Figure:
    """Bars by stage, two panels a loop: error of the prediction and of the tracking."""
    titles = [f"{story.name}: {what}, {unit}" for story, told in loops for what, unit in _units(told)]
    figure = make_subplots(rows=1, cols=len(titles), subplot_titles=titles, horizontal_spacing=0.07)
    for place, (_, told) in enumerate(loops):
        factor, _unit = error_scale(told.finding)
        predicted = told.finding.error[tested_part(told.finding)]
        factor_m, _unit_m = _tracking_scale(told)
        tracked = {stage: factor_m * mission.numbers["tracking_rmse_m"] for stage, mission in told.missions.items()}
        predictions = {stage: factor * predicted[stage] for stage in STAGES if stage in predicted}
        for column, values in enumerate((predictions, tracked), start=1 + 2 * place):
            for stage, value in values.items():
                here = {"x": [stage], "showlegend": column == 1, "row": 1, "col": column}
                figure.add_bar(y=[value], **here, **stage_bar(stage, [value]))
        figure.update_yaxes(range=[0, HEADROOM * max(tracked.values(), default=1.0)], row=1, col=2 + 2 * place)
        figure.update_yaxes(range=[0, HEADROOM * max(predictions.values(), default=1.0)], row=1, col=1 + 2 * place)
    styled(figure, 340, bargap=0.35).update_layout(legend={"y": -0.04, "yanchor": "top"})
    return figure.update_xaxes(showticklabels=False)


def _units(told: Told) -> tuple[tuple[str, str], tuple[str, str]]:
    return ("prediction", error_scale(told.finding)[1]), ("tracking", _tracking_scale(told)[1])


def _tracking_scale(told: Told) -> tuple[float, str]:
    return scale([mission.numbers["tracking_rmse_m"] for mission in told.missions.values()], "m")


def left_over_figure(finding: Finding) -> go.Figure | None:
    """Measured minus predicted over place and speed, before and after."""
    before, after = ("calibrated", "augmented") if finding.effects else ("nominal", "calibrated")
    drawn = [panel for trace in finding.traces for panel in panels(finding, trace)]
    kept = [replace(p, signals={name: values for name, values in p.signals.items() if name in SIGNALS}) for p in drawn]
    return residual_figure([panel for panel in kept if {before, after} <= set(panel.predicted)], before, after)


def mission_figure(missions: Mapping[str, Mission]) -> go.Figure:
    """Where the capsule was to go and went under each model, and by how much it was off."""
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    first = next(iter(missions.values()))
    _line(figure, first.time_s, first.reference_m, "reference", MUTED, 1, width=3.0)
    for stage, mission in missions.items():
        for row, metres in ((1, mission.position_m), (2, mission.position_m - mission.reference_m)):
            _line(figure, mission.time_s, metres, stage, STAGE_COLOURS[stage], row)
    figure.update_yaxes(title_text="position in mm", row=1, col=1)
    figure.update_yaxes(title_text="error in mm", row=2, col=1)
    figure.update_xaxes(title_text="time in s", row=2, col=1)
    return styled(figure, 560)


def _line(figure: go.Figure, t: Array, metres: Array, name: str, colour: str, row: int, width: float = 1.6) -> None:
    x, y = thinned(t, 1e3 * metres, POINTS)
    line = {"color": colour, "width": width}
    figure.add_scatter(
        x=x, y=y, name=name, mode="lines", line=line, showlegend=row == 1, legendgroup=name, row=row, col=1
    )
