"""The report of a closed-loop run: one page with the path, the error, the command and what the estimator believed."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from controller.drives import DRIVES
from hil.app.scenario.scenario import TrackScenario
from hil.app.track.loop import LoopTrace
from hil.app.track.summary import not_ok, times, tracking, verdict
from hil.report.builder import page
from hil.report.theme import INK, MUTED, POINTS, Array, axes, line, line_look, styled, thinned
from models.words.quantities import fixed, quantity
from plant import layout as at

Found = dict[str, Any]
Run = tuple[Found, LoopTrace]
ACROSS = 2
"""Small multiples side by side."""


def page_html(scenario: TrackScenario, runs: Sequence[Run]) -> str:
    """One self-contained page for the runs of a scenario, one a controller."""
    found = [one for one, _ in runs]
    return page(
        "track.html.j2",
        scenario=scenario,
        best=min(one["tracking_rmse_m"] for one in found),
        runs=[_numbers(one) for one in found],
        checks=[c | {"controller": one["controller"], "said": verdict(c)} for one in found for c in one["checks"]],
        paths=_path(scenario, *runs[0]) if len(runs) == 1 else _errors(scenario, runs),
        inside=_inside(scenario, runs),
    )


def _numbers(found: Found) -> Found:
    """A run's JSON object, with its numbers as the tables have them."""
    *lengths, _, wall, effort, violations = tracking(found)
    uses = {name: fixed(100 * share, 1) for name, share in found["limit_use"].items()}
    return found | {
        "tracked": [*lengths, wall, effort, violations, not_ok(found)],
        "uses": uses,
        "ticked": times(found),
    }


def _error_mm(scenario: TrackScenario, trace: LoopTrace) -> Array:
    rows = trace.rows
    return np.asarray(1e3 * (rows[:, at.O_X] - scenario.reference.position(rows[:, at.O_T])))


def _path(scenario: TrackScenario, found: Found, trace: LoopTrace) -> go.Figure:
    """The path of one run over its reference, and its error."""
    t, x = trace.rows[:, at.O_T], trace.rows[:, at.O_X]
    figure = axes("time in s", ("position in mm", "error in mm"), 620)
    line(figure, t, 1e3 * scenario.reference.position(t), "reference", {"color": MUTED, "width": 3.0})
    line(figure, t, 1e3 * x, found["controller"], line_look(0))
    line(figure, t, _error_mm(scenario, trace), found["controller"], line_look(0), row=2)
    return figure


def _errors(scenario: TrackScenario, runs: Sequence[Run]) -> go.Figure:
    """The errors of many runs in small multiples, in each those of the others behind."""
    t, rows = runs[0][1].rows[:, at.O_T], math.ceil(len(runs) / ACROSS)
    errors = [_error_mm(scenario, trace) for _, trace in runs]
    titles = [f"{found['controller']}: {quantity(found['tracking_rmse_m'], 'm')} rms" for found, _ in runs]
    height = 90 + 200 * rows
    shared: dict[str, Any] = {"shared_xaxes": "all", "shared_yaxes": "all", "subplot_titles": titles}
    shared |= {"horizontal_spacing": 0.04, "vertical_spacing": 44 / height}
    figure = make_subplots(rows=rows, cols=ACROSS, **shared)
    for place, (found, _) in enumerate(runs):
        here: dict[str, Any] = {"row": place // ACROSS + 1, "col": place % ACROSS + 1}
        for error in (other for k, other in enumerate(errors) if k != place):
            x, y = thinned(t, error, POINTS // 8)
            look = {"color": "#c6ced6", "width": 0.8}
            figure.add_scatter(x=x, y=y, mode="lines", line=look, hoverinfo="skip", **here)
        line(figure, t, errors[place], found["controller"], {"color": INK}, **here)
    for col in range(1, ACROSS + 1):
        figure.update_xaxes(title_text="time in s", row=rows, col=col)
    largest = float(np.quantile(np.abs(np.concatenate(errors)), 0.995))
    figure.update_yaxes(range=[-1.1 * largest, 1.1 * largest]).update_yaxes(title_text="error in mm", col=1)
    return styled(figure, height, showlegend=False)


def _inside(scenario: TrackScenario, runs: Sequence[Run]) -> go.Figure:
    """Command, error of the estimate and disturbance; of several runs one shows, the legend brings in the others."""
    drive = DRIVES[scenario.kind]
    titles = (drive.shown[-1], "estimate less truth in mm", "disturbance in mN")
    figure = axes("time in s", titles, 760, spacing=0.05)
    best = min(range(len(runs)), key=lambda k: runs[k][0]["tracking_rmse_m"])
    for k, (found, trace) in enumerate(runs):
        truth = np.interp(trace.time_s, trace.rows[:, at.O_T], trace.rows[:, at.O_X])
        command = (1e3 if drive.placed else 1.0) * trace.command
        beliefs = (command, 1e3 * np.nan_to_num(trace.position_m - truth), 1e3 * trace.disturbance_N)
        shown = True if k == best else "legendonly"
        for row, values in enumerate(beliefs, start=1):
            line(figure, trace.time_s, values, found["controller"], line_look(k), row, visible=shown)
    return figure
