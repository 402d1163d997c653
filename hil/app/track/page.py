"""The results of closed-loop runs: tables on the terminal, and a page with path, error, command and estimate."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from controller.drives import DRIVES
from controller.supervision.fallback import DONE
from hil.app import console
from hil.app.scenario.model_use import chosen_words, health_words, offer_words
from hil.app.scenario.scenario import TrackScenario
from hil.app.track.loop import LoopTrace
from hil.app.track.score import HARD
from hil.report.builder import page
from hil.report.theme import INK, MUTED, POINTS, Array, axes, line, line_look, styled, thinned
from hil.report.words import column_words
from models.words.quantities import fixed, number, quantity
from models.words.sentences import Sentences
from plant import layout as at

Found = dict[str, Any]
Run = tuple[Found, LoopTrace]
_WORDS: Final = ("controller", "check", "ticks not ok", "largest use of a hard limit")
"""Columns that hold words."""
TEXT: Final = Sentences(__file__)
ACROSS = 2
"""Small multiples side by side."""


def page_html(scenario: TrackScenario, runs: Sequence[Run]) -> str:
    """One self-contained page for the runs of a scenario, one for each controller."""
    found = [one for one, _ in runs]
    return page(
        "track.html.j2",
        scenario=scenario,
        best=min(one["tracking_rmse_m"] for one in found),
        runs=[_numbers(one) for one in found],
        checks=[
            c | {"controller": one["controller"], "words": check_words(c), "said": verdict(c)}
            for one in found
            for c in one["checks"]
        ],
        paths=_path(scenario, *runs[0]) if len(runs) == 1 else _errors(scenario, runs),
        inside=_inside(scenario, runs),
    )


def _numbers(found: Found) -> Found:
    """The JSON object of a run, with its numbers as in the tables."""
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
    """The path of one run with its reference, and its error."""
    t, x = trace.rows[:, at.O_T], trace.rows[:, at.O_X]
    figure = axes("time in s", ("position in mm", "error in mm"), 620)
    line(figure, t, 1e3 * scenario.reference.position(t), "reference", {"color": MUTED, "width": 3.0})
    line(figure, t, 1e3 * x, found["controller"], line_look(0))
    line(figure, t, _error_mm(scenario, trace), found["controller"], line_look(0), row=2)
    return figure


def _errors(scenario: TrackScenario, runs: Sequence[Run]) -> go.Figure:
    """The errors of many runs in small multiples, each with those of the others behind."""
    t, rows = runs[0][1].rows[:, at.O_T], math.ceil(len(runs) / ACROSS)
    errors = [_error_mm(scenario, trace) for _, trace in runs]
    titles = [f"{found['controller']}: {quantity(found['tracking_rmse_m'], 'm')} rms" for found, _ in runs]
    height = 90 + 200 * rows
    shared: dict[str, Any] = {"shared_xaxes": "all", "shared_yaxes": "all", "subplot_titles": titles}
    shared |= {"horizontal_spacing": 0.04, "vertical_spacing": 44 / height}
    figure = make_subplots(rows=rows, cols=ACROSS, **shared)
    for panel, (found, _) in enumerate(runs):
        here: dict[str, Any] = {"row": panel // ACROSS + 1, "col": panel % ACROSS + 1}
        for error in (other for k, other in enumerate(errors) if k != panel):
            x, y = thinned(t, error, POINTS // 8)
            look = {"color": "#c6ced6", "width": 0.8}
            figure.add_scatter(x=x, y=y, mode="lines", line=look, hoverinfo="skip", **here)
        line(figure, t, errors[panel], found["controller"], {"color": INK}, **here)
    for col in range(1, ACROSS + 1):
        figure.update_xaxes(title_text="time in s", row=rows, col=col)
    largest = float(np.quantile(np.abs(np.concatenate(errors)), 0.995))
    figure.update_yaxes(range=[-1.1 * largest, 1.1 * largest]).update_yaxes(title_text="error in mm", col=1)
    return styled(figure, height, showlegend=False)


def _inside(scenario: TrackScenario, runs: Sequence[Run]) -> go.Figure:
    """Command, error of the estimate and disturbance; of several runs the best is shown, the others from the legend."""
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


def say(scenario: TrackScenario, found: Sequence[Mapping[str, Any]], out: Path | None) -> None:
    """Print the JSON objects of a scenario's runs as tables, and where the report is."""
    first, run = found[0], {"name": scenario.name, "kind": scenario.kind, "seconds": scenario.duration_s}
    console.say(TEXT("run", seed=first["seed"], model=first["model"], **run))
    heads = ("rmse mm", "max mm", "final mm", "mean mm/s", "wall mN", "effort mN", "violations")
    _print(heads, [[one["controller"], *tracking(one)] for one in found])
    _print(_WORDS[2:], [[one["controller"], not_ok(one), most_used(one)] for one in found])
    steps = ("solve ms: median", "p99", "max", "estimate ms: median", "p99", "max")
    _print(steps, [[one["controller"], *times(one)] for one in found])
    checks = [
        [one["controller"], check_words(check), number(check["value"]), number(check["limit"]), verdict(check)]
        for one in found
        for check in one["checks"]
    ]
    if checks:
        _print(("check", "value", "at most", "verdict"), checks)
    for one in found:
        ended = "" if one["ended"] == DONE else f"ended: {one['ended']}"
        changes = [TEXT("stays" if e["after"] == e["before"] else "change", **e) for e in one["events"]]
        lines = filter(None, (chosen_words(one), *changes, ended, health_words(one), offer_words(one)))
        console.say(*(f"{one['controller']}: {words}" for words in lines))
    if out is not None:
        console.say(f"report: {out / 'track.html'}")


def not_ok(found: Mapping[str, Any]) -> str:
    """Ticks by status, without those that are ok: "lost 5000, limited 12"."""
    return ", ".join(f"{name} {n}" for name, n in found["ticks"].items() if n and name != "ok") or "none"


def most_used(found: Mapping[str, Any]) -> str:
    """The limit of the true state that was used most: "gap 83 %"."""
    share, name = max((share, name) for name, share in found["limit_use"].items() if name in HARD)
    return f"{name} {100 * share:.0f} %"


def times(found: Mapping[str, Any]) -> list[str]:
    """Median, 99th percentile and maximum of the controller's and the estimator's time for a tick, in ms."""
    return [fixed(found[what][key], 3) for what in ("solve_ms", "estimate_ms") for key in ("median", "p99", "max")]


def check_words(check: Mapping[str, Any]) -> str:
    """What a check compares, and its unit: "settling time, s"."""
    return ", ".join(filter(None, column_words(check["check"])))


def verdict(check: Mapping[str, Any]) -> str:
    return "passed" if check["passed"] else "FAILED"


def tracking(one: Mapping[str, Any]) -> list[str]:
    """Errors in mm, mean speed in mm/s, forces in mN, and violations."""
    lengths = ("tracking_rmse_m", "tracking_max_m", "final_error_m", "mean_speed_m_s")
    numbers = [fixed(1e3 * one[key], 3) for key in lengths]
    numbers += [fixed(1e3 * one[key], 1) for key in ("wall_force_max_N", "effort")]
    return [*numbers, str(one["hard_violations"])]


def _print(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    table = console.text_table("", ("controller", *heads), _WORDS, bare=True)
    for row in rows:
        table.add_row(*row)
    console.summary().print(table)
