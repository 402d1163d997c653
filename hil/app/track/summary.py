"""The outcome of closed-loop runs in words, numbers and figures, the same on the terminal and on the page."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots
from rich.table import Table

from controller.drives import DRIVES
from controller.supervision.fallback import DONE
from hil.app import console
from hil.app.scenario.model_use import chosen_words, health_words, offer_words
from hil.app.scenario.scenario import TrackScenario
from hil.app.track.loop import LoopTrace
from hil.app.track.score import HARD
from hil.report.builder import page
from hil.report.theme import FLOOR, MUTED, POINTS, Array, axes, line, line_look, styled, thinned
from hil.report.words import column_words
from models.words.quantities import fixed, number, quantity
from models.words.sentences import Sentences
from plant import layout as at

Found = Mapping[str, Any]
TEXT: Final = Sentences(__file__)
HEADS: Final = (
    "rmse mm", "max mm", "final mm", "mean mm/s", "wall mN", "effort mN", "violations", "ticks not ok",
)  # fmt: skip
TIMES: Final = ("solve ms: median", "p99", "max", "estimate ms: median", "p99", "max")
_MOST_USED: Final = "largest use of a hard limit"
_WORDS: Final = ("controller", "check", HEADS[-1], _MOST_USED)  # Columns that hold words


@dataclass(frozen=True)
class LoopRun:
    """A run of `scenario`: its JSON object `found`, its trace, and what is said of it in `lines`."""

    scenario: TrackScenario
    found: Found
    trace: LoopTrace
    lines: Sequence[str]


def headline(found: Sequence[Found]) -> str:
    """Scenario, controller, model and rms error of the best of the runs; how it ended, where that was early."""
    best = min(found, key=lambda one: (one["ended"] != DONE, one["tracking_rmse_m"]))
    if best["ended"] != DONE:
        return TEXT("all_ended" if len(found) > 1 else "ended", **best)
    return TEXT("best" if len(found) > 1 else "alone", **best)


def lines_of(found: Found) -> list[str]:
    """What a run of a loop came to: what leads and why, changes, how it ended, the monitor's verdict, the offer."""
    changes = [TEXT("stays" if e["after"] == e["before"] else "change", **e) for e in found["events"]]
    ended = "" if found["ended"] == DONE else f"ended: {found['ended']}"
    return [*filter(None, (chosen_words(found), *changes, ended, health_words(found), offer_words(found)))]


def lines_of_runs(head: str, runs: Sequence[LoopRun], page: Path | None) -> Iterator[str | Table]:
    """What kind of run it was, the headline, the runs as tables, what is said of each, and where the page is."""
    found = [run.found for run in runs]
    hard = [max((share, name) for name, share in one["limit_use"].items() if name in HARD) for one in found]
    yield from (head, headline(found))
    yield _table(HEADS, map(tracking, found), found)
    yield _table([_MOST_USED], ([f"{name} {100 * share:.0f} %"] for share, name in hard), found)
    yield _table(TIMES, map(times, found), found)
    if checks := check_rows(found):
        yield _table(("check", "value", "at most", "verdict"), checks)
    for run in runs:
        whose = f"{run.found['controller']}: " if len(runs) > 1 else ""
        yield from (f"{whose}{words}" for words in run.lines)
    if page is not None:
        yield f"report: {page}"


def check_rows(found: Sequence[Found]) -> list[list[str]]:
    return [
        [
            *(one["controller"], ", ".join(filter(None, column_words(check["check"])))),
            *(number(check["value"]), number(check["limit"]), "passed" if check["passed"] else "FAILED"),
        ]
        for one in found
        for check in one.get("checks", ())
    ]


def times(found: Found) -> list[str]:
    """Median, 99th percentile and maximum of the controller's and the estimator's time for a tick, in ms."""
    return [fixed(found[what][key], 3) for what in ("solve_ms", "estimate_ms") for key in ("median", "p99", "max")]


def tracking(found: Found) -> list[str]:
    """Errors in mm, mean speed in mm/s, forces in mN, violations, and the ticks that were not ok: "lost 5000"."""
    lengths = ("tracking_rmse_m", "tracking_max_m", "final_error_m", "mean_speed_m_s")
    numbers = [fixed(1e3 * found[key], 3) for key in lengths]
    numbers += [fixed(1e3 * found[key], 1) for key in ("wall_force_max_N", "effort")]
    not_ok = ", ".join(f"{name} {n}" for name, n in found["ticks"].items() if n and name != "ok") or "none"
    return [*numbers, str(found["hard_violations"]), not_ok]


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]], found: Sequence[Found] = ()) -> Table:
    """A table of rows, which begin with the controller or get it from what was `found`."""
    table = console.text_table("", ("controller", *heads), _WORDS, bare=True)
    for k, row in enumerate(rows):
        table.add_row(*([found[k]["controller"]] if found else []), *row)
    return table


ACROSS = 2  # Small multiples side by side


def page_html(head: str, runs: Sequence[LoopRun]) -> str:
    """One self-contained page for the runs of a scenario, one for each controller; `head` says what kind of run."""
    found = [run.found for run in runs]
    uses = [*found[0]["limit_use"]]
    return page(
        "runs.html.j2",
        title=headline(found),
        kind="named" if any(one["ended"] == DONE for one in found) else "unknown",
        head=head,
        lines=[[one["controller"], run.lines] for run, one in zip(runs, found, strict=True)],
        paths=_path(runs[0]) if len(runs) == 1 else _errors(runs),
        faults=found[0].get("faults"),
        inside=_inside(runs),
        numbers=[HEADS, [[one["controller"], *tracking(one)] for one in found]],
        uses=[
            [name.replace("_", " ") for name in uses],
            [[one["controller"], *(fixed(100 * one["limit_use"][name], 1) for name in uses)] for one in found],
        ],
        times=[TIMES, [[one["controller"], *times(one)] for one in found]],
        checks=check_rows(found),
    )


def _error_mm(run: LoopRun) -> Array:
    rows = run.trace.rows
    return np.asarray(1e3 * (rows[:, at.O_X] - run.scenario.reference.position(rows[:, at.O_T])))


def _path(run: LoopRun) -> go.Figure:
    t, x, name = run.trace.rows[:, at.O_T], run.trace.rows[:, at.O_X], run.found["controller"]
    figure = axes("time in s", ("position in mm", "error in mm"), 620)
    line(figure, t, 1e3 * run.scenario.reference.position(t), "reference", {"color": MUTED, "width": 3.0})
    line(figure, t, 1e3 * x, name, line_look(0))
    line(figure, t, _error_mm(run), name, line_look(0), row=2)
    for fault in run.found.get("faults", ()):
        figure.add_vline(x=fault["at_s"], line={"color": MUTED, "width": 1.2, "dash": "dot"})
    return figure


def _errors(runs: Sequence[LoopRun]) -> go.Figure:
    """The errors of many runs in small multiples, each with those of the others behind."""
    rows, errors = math.ceil(len(runs) / ACROSS), [_error_mm(run) for run in runs]
    titles = [f"{run.found['controller']}: {quantity(run.found['tracking_rmse_m'], 'm')} rms" for run in runs]
    height = 90 + 200 * rows
    shared: dict[str, Any] = {"shared_xaxes": "all", "shared_yaxes": "all", "subplot_titles": titles}
    shared |= {"horizontal_spacing": 0.04, "vertical_spacing": 44 / height}
    figure = make_subplots(rows=rows, cols=ACROSS, **shared)
    for panel, run in enumerate(runs):
        here: dict[str, Any] = {"row": panel // ACROSS + 1, "col": panel % ACROSS + 1}
        for other, error in zip(runs, errors, strict=True):
            if other is not run:
                x, y = thinned(other.trace.rows[:, at.O_T], error, POINTS // 8)
                look = {"color": FLOOR, "width": 0.8}
                figure.add_scatter(x=x, y=y, mode="lines", line=look, opacity=0.6, hoverinfo="skip", **here)
        line(figure, run.trace.rows[:, at.O_T], errors[panel], run.found["controller"], line_look(panel), **here)
    for col in range(1, ACROSS + 1):
        figure.update_xaxes(title_text="time in s", row=rows, col=col)
    largest = 1.05 * max(float(np.max(np.abs(error))) for error in errors)
    figure.update_yaxes(range=[-largest, largest]).update_yaxes(title_text="error in mm", col=1)
    return styled(figure, height, showlegend=False)


def _inside(runs: Sequence[LoopRun]) -> go.Figure:
    """Command, error of the estimate and disturbance; of several runs the best is shown, the others from the legend."""
    drive = DRIVES[runs[0].scenario.kind]
    titles = (drive.shown[-1], "estimate less truth in mm", "disturbance in mN")
    figure = axes("time in s", titles, 760, spacing=0.05)
    best = min(range(len(runs)), key=lambda k: runs[k].found["tracking_rmse_m"])
    for k, run in enumerate(runs):
        trace = run.trace
        truth = np.interp(trace.time_s, trace.rows[:, at.O_T], trace.rows[:, at.O_X])
        command = (1e3 if drive.placed else 1.0) * trace.command
        beliefs = (command, 1e3 * np.nan_to_num(trace.position_m - truth), 1e3 * trace.disturbance_N)
        shown = True if k == best else "legendonly"
        for row, values in enumerate(beliefs, start=1):
            line(figure, trace.time_s, values, run.found["controller"], line_look(k), row, visible=shown)
    return figure
