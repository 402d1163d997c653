"""The page of a run that learned: tracking error over time, events, the models before and after."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go

from hil.app.console import json_text
from hil.app.learn.learner import Lesson
from hil.app.scenario.bus_scenario import SilScenario
from hil.app.scenario.model_use import model_facts
from hil.app.sil.loop import TEXT, SilTrace, judged_loop
from hil.app.sil.testbed import believed_on_bus
from hil.report.builder import page
from hil.report.theme import INK, MUTED, axes, line, line_colour
from models.effects import effect_words
from models.words.sentences import listed
from plant import layout as at

PAGE: Final = "learning.html"
NUMBERS: Final = "learning.json"
WINDOW_S: Final = 60.0  # before an event, over which the error is averaged
_HEIGHT: Final = 460  # pixels
_CLOSE: Final = 0.04  # Share of the run within which two numbers would overlap; the later one is drawn lower
_COLOURS: Final = {
    "broken_at_s": 1, "asked_at_s": 4, "experiment_at_s": 5, "offered_at_s": 0, "taken_at_s": 2, "withdrawn_at_s": 1,
}  # fmt: skip
"""Colours of the events of a `Lesson`, by their number in the palette."""


def learning_files(out: Path, scenario: SilScenario, found: dict[str, Any], trace: SilTrace) -> dict[Path, str]:
    seconds, errors_m = error_by_second(scenario, trace)
    marks = instants(scenario, trace)
    numbers = {
        "second": seconds.tolist(),
        "rms_error_m": errors_m.tolist(),
        "instants": [{"t_s": t, "what": what} for t, what in marks],
        "parts": parts(seconds, errors_m, marks),
        "learned": found["learned"],
    }
    return {out / PAGE: page_html(scenario, found, trace, numbers), out / NUMBERS: json_text(numbers)}


def error_by_second(scenario: SilScenario, trace: SilTrace) -> tuple[np.ndarray, np.ndarray]:
    """Begins of whole seconds (n,) and the rms error in m of the true position over each."""
    t, x = trace.rows[:, at.O_T], trace.rows[:, at.O_X]
    squares = (x - judged_loop(scenario, trace).reference.position(t)) ** 2
    second = t.astype(np.int64)
    count = np.bincount(second)
    whole = np.flatnonzero(count)
    return whole.astype(float), np.sqrt(np.bincount(second, squares)[whole] / count[whole])


def instants(scenario: SilScenario, trace: SilTrace) -> list[tuple[float, str]]:
    """Time in s and words of each event, in order of time: hidden effects that begin, known from the scenario file, and
    what monitor, learner, controller and model switch did.
    """
    marks = [
        (values["onset_s"], TEXT("event.onset", effect=effect_words(effect)))
        for effect, values in scenario.loop.truth.hidden.items()
        if values.get("onset_s", 0.0) > 0
    ]
    marks += [(begin, TEXT("event.experiment_at_s")) for begin in trace.experiments_at]
    steps = [name for name in _COLOURS if name != "experiment_at_s"]
    times = [(getattr(lesson, name), TEXT(f"event.{name}")) for lesson in trace.lessons for name in steps]
    return sorted([*marks, *((when, what) for when, what in times if when is not None)])


def rms_m(seconds: np.ndarray, errors_m: np.ndarray, begin_s: float, end_s: float) -> float | None:
    """Rms of the errors of the whole seconds from `begin_s` to `end_s`, in m; None where there is none."""
    part = (seconds >= begin_s) & (seconds + 1 <= end_s)
    return float(np.sqrt(np.mean(errors_m[part] ** 2))) if part.any() else None


def parts(
    seconds: np.ndarray, errors_m: np.ndarray, marks: Sequence[tuple[float, str]]
) -> list[dict[str, float | str | None]]:
    """The rms error in m over the last minute, or less, before each instant and before the end."""
    ends = [*marks, (float(seconds[-1]) + 1.0, TEXT("event.end"))]
    spans = [(what, max(before, end - WINDOW_S), end) for (before, _), (end, what) in pairwise([(0.0, ""), *ends])]
    return [
        {"until": what, "from_s": begin, "to_s": end, "rms_error_m": rms_m(seconds, errors_m, begin, end)}
        for what, begin, end in spans
    ]


def page_html(scenario: SilScenario, found: dict[str, Any], trace: SilTrace, numbers: dict[str, Any]) -> str:
    models = [(one.at_s, model_facts(believed_on_bus(scenario, one.values))) for one in trace.offers]
    return page(
        "learning.html.j2",
        scenario=scenario.loop,
        title=f"{scenario.loop.name}: {came_to(trace.lessons)}",
        found=found,
        stopped=trace.stopped_because,
        error=error_figure(numbers),
        numbers=numbers,
        lessons=[lesson.words for lesson in trace.lessons],
        models=models,
    )


def came_to(lessons: Sequence[Lesson]) -> str:
    taken = [one for one in lessons if one.taken_at_s is not None]
    kept = [one for one in taken if one.withdrawn_at_s is None]
    if not lessons:
        return TEXT("came_to.nothing")
    names = listed(dict.fromkeys(effect_words(name) for one in kept for name in one.effects)) or TEXT(
        "came_to.calibration"
    )
    if kept:
        return TEXT("came_to.taken", names=names, seconds=kept[0].taken_at_s)
    return TEXT("came_to.withdrawn" if taken else "came_to.none")


def error_figure(numbers: Mapping[str, Any]) -> go.Figure:
    """The error of each second; each instant is a dotted line with its number in the table below."""
    t, error = np.array(numbers["second"]), 1e3 * np.array(numbers["rms_error_m"])
    figure = axes("time in s", ["rms error of each second in mm"], _HEIGHT, showlegend=False)
    line(figure, t + 0.5, error, "error", {"color": INK}, points=len(t) + 1)
    colours = {TEXT(f"event.{name}"): number for name, number in _COLOURS.items()}
    top, right, level = float(error.max(initial=0.0)) or 1.0, -np.inf, 0
    for number, mark in enumerate(numbers["instants"], start=1):
        level = level + 1 if mark["t_s"] - right < _CLOSE * (t[-1] + 1) else 0
        right = mark["t_s"]
        colour = line_colour(colours.get(mark["what"], 3))
        figure.add_vline(x=mark["t_s"], line={"color": colour, "width": 1.2, "dash": "dot"})
        at = {"x": mark["t_s"], "y": top * (1.42 - 0.1 * (level % 4)), "xanchor": "left"}
        figure.add_annotation(**at, text=str(number), showarrow=False, font={"size": 13, "color": MUTED})
    return figure.update_yaxes(range=[0, 1.5 * top])
