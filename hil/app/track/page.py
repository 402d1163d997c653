"""The report of a closed-loop run: one page with the path, the error, the command and what the estimator believed."""

import math
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from controller.drives import DRIVES
from hil.app.quantities import fixed, number, quantity
from hil.app.report.document import document, heading, mixed_table, table
from hil.app.report.panels import thinned
from hil.app.report.theme import INK, MUTED, figure_html, line_look, styled
from hil.app.report.words import column_words
from hil.app.scenario.scenario import TrackScenario
from hil.app.track.loop import Trace
from hil.app.track.summary import not_ok, times, verdict
from plant import layout as at

Array = NDArray[np.float64]
Run = tuple[dict[str, Any], Trace]
POINTS = 4000  # of a line
ACROSS = 2
"""Small multiples side by side."""


def page_html(scenario: TrackScenario, runs: Sequence[Run]) -> str:
    """One self-contained page for the runs of a scenario, one a controller."""
    best = min(found["tracking_rmse_m"] for found, _ in runs)
    title = f"{scenario.name}: tracking within {quantity(best, 'm')} rms"
    failed = [f"{f['controller']}: {c['check']}" for f, _ in runs for c in f["checks"] if not c["passed"]]
    warning = f'<div class="warning"><p>Failed: {escape("; ".join(failed))}.</p></div>' if failed else ""
    first = runs[0][0]
    head = heading(
        f"Closed loop in simulation · {scenario.kind} rig · seed {first['seed']} · {first['model']} model",
        title,
        more=warning,
    )
    sections = [
        ("numbers", "Numbers", _table(runs)),
        ("limits", "Largest use of each limit, %", _uses(runs)),
        *([("checks", "Checks", checks)] if (checks := _checks(runs)) else []),
        ("ticks", "Time in a tick, ms", _ticks(runs)),
        ("paths", "Path and error", _paths_words(runs) + figure_html(_paths(scenario, runs), "figure-0")),
        ("inside", "Behind it", figure_html(_inside(scenario, runs), "figure-1")),
    ]
    return document(title, head, sections)


def _table(runs: Sequence[Run]) -> str:
    heads = (
        ("controller", True),
        ("rms error, mm", False),
        ("largest, mm", False),
        ("final, mm", False),
        ("wall force, mN", False),
        ("effort, mN", False),
        ("hard violations", False),
        ("ticks not ok", True),
    )
    rows = []
    for found, _ in runs:
        numbers = [fixed(1e3 * found[key], 3) for key in ("tracking_rmse_m", "tracking_max_m", "final_error_m")]
        numbers += [fixed(1e3 * found[key], 1) for key in ("wall_force_max_N", "effort")]
        rows.append([escape(found["controller"]), *numbers, str(found["hard_violations"]), escape(not_ok(found))])
    return mixed_table(heads, rows)


def _ticks(runs: Sequence[Run]) -> str:
    heads = ("controller", *(f"{what}, {which}" for what in ("plan", "estimate") for which in ("median", "p99", "max")))
    return table(heads, [[escape(found["controller"]), *times(found)] for found, _ in runs])


def _uses(runs: Sequence[Run]) -> str:
    names = list(runs[0][0]["limit_use"])
    rows = [
        [escape(found["controller"]), *(fixed(100 * found["limit_use"][name], 1) for name in names)]
        for found, _ in runs
    ]
    return table(("controller", *(escape(name.replace("_", " ")) for name in names)), rows)


def _checks(runs: Sequence[Run]) -> str:
    rows = [
        [
            escape(found["controller"]),
            escape(" in ".join(word for word in column_words(check["check"]) if word)),
            number(check["value"]),
            number(check["limit"]),
            f'<span class="{"pass" if check["passed"] else "fail"}">{verdict(check)}</span>',
        ]
        for found, _ in runs
        for check in found["checks"]
    ]
    return table(("controller", "check", "value", "at most", "verdict"), rows, left=2) if rows else ""


def _line(t: Array, y: Array, name: str, look: dict[str, Any], **more: Any) -> go.Scatter:
    t, y = thinned(t, y, POINTS)
    return go.Scatter(x=t, y=y, name=name, mode="lines", line={"width": 1.5, **look}, **more)


def _paths_words(runs: Sequence[Run]) -> str:
    if len(runs) == 1:
        return "<p>The grey line is the reference.</p>"
    return (
        "<p>One panel a controller, all with the same axes: above each stands its rms error, the grey lines behind are"
        " the errors of the others.</p>"
    )


def _paths(scenario: TrackScenario, runs: Sequence[Run]) -> go.Figure:
    """One run over its reference and its error; of many, the errors in small multiples."""
    t = runs[0][1].rows[:, at.O_T]
    target = scenario.reference.position(t)
    errors = [(found, 1e3 * (trace.rows[:, at.O_X] - target)) for found, trace in runs]
    if len(runs) > 1:
        return _multiples(t, errors)
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    (found, error), x = errors[0], runs[0][1].rows[:, at.O_X]
    figure.add_trace(_line(t, 1e3 * target, "reference", {"color": MUTED, "width": 3.0}), row=1, col=1)
    figure.add_trace(_line(t, 1e3 * x, found["controller"], line_look(0)), row=1, col=1)
    figure.add_trace(_line(t, error, found["controller"], line_look(0), showlegend=False), row=2, col=1)
    figure.update_yaxes(title_text="position in mm", row=1, col=1)
    figure.update_yaxes(title_text="error in mm", row=2, col=1)
    figure.update_xaxes(title_text="time in s", row=2, col=1)
    return styled(figure, 620)


def _multiples(t: Array, errors: Sequence[tuple[dict[str, Any], Array]]) -> go.Figure:
    rows = math.ceil(len(errors) / ACROSS)
    titles = [f"{found['controller']}: {quantity(found['tracking_rmse_m'], 'm')} rms" for found, _ in errors]
    height = 90 + 200 * rows
    figure = make_subplots(
        rows=rows,
        cols=ACROSS,
        shared_xaxes="all",
        shared_yaxes="all",
        horizontal_spacing=0.04,
        vertical_spacing=44 / height,
        subplot_titles=titles,
    )
    for place, (found, own) in enumerate(errors):
        row, col = place // ACROSS + 1, place % ACROSS + 1
        for other, error in errors:
            if other is not found:
                x, y = thinned(t, error, POINTS // 8)
                figure.add_scatter(
                    x=x, y=y, mode="lines", line={"color": "#c6ced6", "width": 0.8}, hoverinfo="skip", row=row, col=col
                )
        figure.add_trace(_line(t, own, found["controller"], {"color": INK}), row=row, col=col)
    for col in range(1, ACROSS + 1):
        figure.update_xaxes(title_text="time in s", row=rows, col=col)
    for row in range(1, rows + 1):
        figure.update_yaxes(title_text="error in mm", row=row, col=1)
    largest = float(np.quantile(np.abs(np.concatenate([error for _, error in errors])), 0.995))
    figure.update_yaxes(range=[-1.1 * largest, 1.1 * largest])
    return styled(figure, height, showlegend=False)


def _inside(scenario: TrackScenario, runs: Sequence[Run]) -> go.Figure:
    """Command, error of the estimate and disturbance; of several runs one shows, the legend brings in the others."""
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.05)
    drive = DRIVES[scenario.kind]
    factor = 1e3 if drive.placed else 1.0
    best = min(range(len(runs)), key=lambda k: runs[k][0]["tracking_rmse_m"])
    for k, (found, trace) in enumerate(runs):
        t, rows = trace.time_s, trace.rows
        truth = np.interp(t, rows[:, at.O_T], rows[:, at.O_X])
        beliefs = (factor * trace.command, 1e3 * np.nan_to_num(trace.position_m - truth), 1e3 * trace.disturbance_N)
        for row, values in enumerate(beliefs, start=1):
            look = {
                "legendgroup": found["controller"],
                "showlegend": row == 1,
                "visible": True if k == best else "legendonly",
            }
            figure.add_trace(_line(t, values, found["controller"], line_look(k), **look), row=row, col=1)
    for row, title in enumerate((drive.shown[-1], "estimate less truth in mm", "disturbance in mN"), start=1):
        figure.update_yaxes(title_text=title, row=row, col=1)
    figure.update_xaxes(title_text="time in s", row=3, col=1)
    return styled(figure, 760)
