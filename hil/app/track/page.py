"""The report of a closed-loop run: one page with the path, the error, the command and what the estimator believed."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

from hil.app.report.page import STYLE
from hil.app.report.panels import thinned
from hil.app.report.theme import MUTED, figure_html, line_colour, styled
from hil.app.scenario.scenario import TrackScenario
from hil.app.track.loop import Trace
from hil.app.track.summary import not_ok, times, verdict
from plant import layout as at

Array = NDArray[np.float64]
POINTS = 4000
_UNITS = {"magnetic": ("carriage, mm", 1e3), "coil": ("coil voltage, V", 1.0), "vibro": ("drive on", 1.0)}


def page_html(scenario: TrackScenario, runs: Sequence[tuple[dict[str, Any], Trace]]) -> str:
    """One self-contained page for the runs of a scenario, one a controller."""
    best = min(found["tracking_rmse_m"] for found, _ in runs)
    title = f"{scenario.name}: tracking within {1e3 * best:.3f} mm rms"
    body = (
        _table(runs)
        + _uses(runs)
        + _checks(runs)
        + "".join(
            f'<section><h2>{name}</h2><div class="figure">{figure_html(figure, f"figure-{k}")}</div></section>'
            for k, (name, figure) in enumerate(
                (("Path and error", _paths(scenario, runs)), ("Behind it", _inside(scenario, runs)))
            )
        )
    )
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{STYLE.read_text(encoding='utf-8')}</style><script>{get_plotlyjs()}</script></head>"
        f'<body><main><header><p class="eyebrow">Closed loop in simulation · {scenario.kind} rig · seed'
        f" {runs[0][0]['seed']} · "
        f"{runs[0][0]['model']} model</p><h1>{escape(title)}</h1></header>{body}</main></body></html>\n"
    )


def _table(runs: Sequence[tuple[dict[str, Any], Trace]]) -> str:
    heads = (
        "Controller",
        "RMSE mm",
        "max mm",
        "final mm",
        "wall mN",
        "effort mN",
        "hard violations",
        "ticks not ok",
        "solve ms, median / p99 / max",
        "estimate ms, median / p99 / max",
    )
    rows = []
    for found, _ in runs:
        numbers = [f"{1e3 * found[key]:.3f}" for key in ("tracking_rmse_m", "tracking_max_m", "final_error_m")]
        numbers += [f"{1e3 * found[key]:.1f}" for key in ("wall_force_max_N", "effort")]
        each = times(found)
        spans = [" / ".join(each[:3]), " / ".join(each[3:])]
        rows.append([found["controller"], *numbers, str(found["hard_violations"]), not_ok(found), *spans])
    return _section("Numbers", heads, rows)


def _uses(runs: Sequence[tuple[dict[str, Any], Trace]]) -> str:
    names = list(runs[0][0]["limit_use"])
    rows = [[found["controller"], *(f"{100 * found['limit_use'][name]:.1f}" for name in names)] for found, _ in runs]
    return _section("Largest use of each limit, %", ("Controller", *(name.replace("_", " ") for name in names)), rows)


def _checks(runs: Sequence[tuple[dict[str, Any], Trace]]) -> str:
    rows = [
        [found["controller"], check["check"], f"{check['value']:.4g}", f"{check['limit']:g}", verdict(check)]
        for found, _ in runs
        for check in found["checks"]
    ]
    return _section("Checks", ("Controller", "check", "value", "at most", "verdict"), rows) if rows else ""


def _section(title: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(h)}</th>" for h in heads)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return (
        f"<section><h2>{escape(title)}</h2><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></section>"
    )


def _line(t: Array, y: Array, name: str, colour: str, **more: Any) -> go.Scatter:
    t, y = thinned(t, y, POINTS)
    return go.Scatter(
        x=t, y=y, name=name, mode="lines", line={"color": colour, "width": more.pop("width", 1.5)}, **more
    )


def _paths(scenario: TrackScenario, runs: Sequence[tuple[dict[str, Any], Trace]]) -> go.Figure:
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    t = runs[0][1].rows[:, at.O_T]
    target = scenario.reference.position(t)
    figure.add_trace(_line(t, 1e3 * target, "reference", MUTED, width=3.0), row=1, col=1)
    for k, (found, trace) in enumerate(runs):
        colour = line_colour(k)
        x = trace.rows[:, at.O_X]
        figure.add_trace(_line(t, 1e3 * x, found["controller"], colour), row=1, col=1)
        figure.add_trace(_line(t, 1e3 * (x - target), found["controller"], colour, showlegend=False), row=2, col=1)
    figure.update_yaxes(title_text="position, mm", row=1, col=1)
    figure.update_yaxes(title_text="error, mm", row=2, col=1)
    figure.update_xaxes(title_text="time, s", row=2, col=1)
    return styled(figure, 620)


def _inside(scenario: TrackScenario, runs: Sequence[tuple[dict[str, Any], Trace]]) -> go.Figure:
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.05)
    unit, scale = _UNITS[scenario.kind]
    for k, (found, trace) in enumerate(runs):
        colour = line_colour(k)
        t, rows = trace.time_s, trace.rows
        truth = np.interp(t, rows[:, at.O_T], rows[:, at.O_X])
        figure.add_trace(_line(t, scale * trace.command, found["controller"], colour), row=1, col=1)
        figure.add_trace(
            _line(t, 1e3 * np.nan_to_num(trace.position_m - truth), found["controller"], colour, showlegend=False),
            row=2,
            col=1,
        )
        figure.add_trace(
            _line(t, 1e3 * trace.disturbance_N, found["controller"], colour, showlegend=False), row=3, col=1
        )
    for row, title in enumerate((unit, "estimate less truth, mm", "disturbance, mN"), start=1):
        figure.update_yaxes(title_text=title, row=row, col=1)
    figure.update_xaxes(title_text="time, s", row=3, col=1)
    return styled(figure, 760)
