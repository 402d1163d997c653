"""The design's plots as one page: Bode, Nyquist, sensitivity, poles, and the loop on set-valued friction."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots
from rich.table import Table

from controller.design.study import Study
from controller.design.tuning import Complex, OpenLoop
from controller.model.control_model import ControlModel
from controller.signals import Array
from hil.app.design.tables import TEXT, balance_lines, cycle_table, margin_table, words_of
from hil.report.builder import page
from hil.report.theme import INK, MUTED, axes, line, line_colour, line_look, styled


@dataclass(frozen=True)
class Drawn:
    """A figure under its heading; `lines` of the terminal and a `note` may stand before it."""

    title: str
    figure: go.Figure
    lines: Sequence[str] = ()
    note: str = ""


def design_html(found: Study, plant: ControlModel, name: str) -> str:
    head = TEXT("title.page", name=name, speed=found.speed_m_s, delay=found.delay_s)
    balance = Drawn("Harmonic balance", balance_figure(found), balance_lines(found), TEXT("balance.note"))
    figures = [*loop_figures(found.loops), Drawn("Stick and slip", run_figure(found)), balance]
    return page_html(head, words_of(found, plant), (margin_table(found), cycle_table(found)), figures)


def loop_figures(loops: Sequence[OpenLoop]) -> list[Drawn]:
    return [
        Drawn("Open loop (Bode)", bode_figure(loops)),
        Drawn("Open loop (Nyquist)", nyquist_figure(loops)),
        Drawn("Sensitivity", sensitivity_figure(loops)),
        Drawn("Closed-loop poles", pole_figure(loops)),
    ]


def page_html(head: str, lines: Sequence[str], tables: Sequence[Table], figures: Sequence[Drawn]) -> str:
    """A page of numbers as the terminal has them, then of figures."""
    shown = [
        {
            "title": table.title,
            "names": [str(column.header) for column in table.columns],
            "rows": zip(*(column.cells for column in table.columns), strict=True),
            "words": [index for index, column in enumerate(table.columns) if column.justify == "left"],
        }
        for table in tables
    ]
    return page("design.html.j2", title=head, lines=lines, tables=shown, figures=figures)


def _look(loops: Sequence[OpenLoop], loop: OpenLoop) -> tuple[str, dict[str, str]]:
    names = list(dict.fromkeys(item.name for item in loops))
    dash = "solid" if loop.phase == "stick" else "dash"
    return f"{loop.name}, {loop.phase}", {"color": line_colour(names.index(loop.name)), "dash": dash}


def bode_figure(loops: Sequence[OpenLoop]) -> go.Figure:
    figure = axes("frequency in Hz", ("|L| in dB", "phase in deg"), 520)
    for loop in loops:
        phase = np.degrees(np.unwrap(np.angle(loop.L)))
        for row, values in ((1, 20 * np.log10(np.abs(loop.L))), (2, phase - 360 * (phase[0] > 90))):
            line(figure, loop.omega / (2 * math.pi), values, *_look(loops, loop), row)
    figure.add_hline(y=0, line={"color": MUTED, "width": 1}, row=1, col=1)
    figure.add_hline(y=-180, line={"color": MUTED, "width": 1}, row=2, col=1)
    return figure.update_xaxes(type="log").update_yaxes(range=[-360, 0], row=2, col=1)


def nyquist_figure(loops: Sequence[OpenLoop]) -> go.Figure:
    figure = axes("real part of L", "imaginary part of L", 520)
    for loop in loops:
        near = np.abs(loop.L) < 6
        line(figure, loop.L.real[near], loop.L.imag[near], *_look(loops, loop), points=near.size)
    _with_circle(figure, "dot")
    figure.add_scatter(x=[-1], y=[0], mode="markers", marker={"color": INK, "symbol": "x", "size": 9}, showlegend=False)
    return figure.update_xaxes(range=[-3, 2]).update_yaxes(range=[-3, 2], scaleanchor="x")


def sensitivity_figure(loops: Sequence[OpenLoop]) -> go.Figure:
    """What each loop makes of a disturbance: below 0 dB it is damped."""
    figure = axes("frequency in Hz", "|1/(1 + L)| in dB", 380)
    for loop in loops:
        values = 20 * np.log10(loop.sensitivity())
        line(figure, loop.omega / (2 * math.pi), values, *_look(loops, loop))
    return figure.update_xaxes(type="log")


def balance_figure(found: Study) -> go.Figure:
    """Gain of friction and controller at -180 deg and that frequency, over the amplitude; cycles stand at 0 dB."""
    titles, shares = ("|N G| in dB", "frequency in Hz"), [0.6, 0.4]
    figure = axes("amplitude in mm", titles, 520, row_heights=shares)
    for number, name in enumerate(found.laws()):
        gain, hertz = crossings(found.wall.N * found.compliance(name), found.wall.omega)
        for row, values in ((1, 20 * np.log10(gain)), (2, hertz)):
            more = {"mode": "lines+markers", "marker": {"size": 4}}
            line(figure, 1e3 * found.wall.amplitude_m, values, name, line_look(number), row, **more)
    for number, (name, cycles) in enumerate(found.balances().items()):
        marker = {"color": line_colour(number), "symbol": "x", "size": 12}
        words = ["hunts" if cycle.stable else "diverges from a larger swing" for cycle in cycles]
        at, hertz = (np.array([getattr(c, key) for c in cycles]) for key in ("amplitude_m", "frequency_Hz"))
        for row, heights in ((1, np.zeros(len(at))), (2, hertz)) if cycles else ():
            line(figure, 1e3 * at, heights, f"cycle, {name}", {}, row, mode="markers", marker=marker, text=words)
    figure.add_hline(y=0, line={"color": MUTED, "width": 1}, row=1, col=1)
    return figure.update_xaxes(type="log").update_yaxes(type="log", row=2, col=1)


def crossings(loop: Complex, omega: Array) -> tuple[Array, Array]:
    """Largest gain at -180 deg and its frequency in Hz by row of `loop` (a, w) over `omega` (w,); NaN: never."""
    now, then = loop[:, :-1], loop[:, 1:]
    crossed = (now.imag * then.imag <= 0) & (now.real < 0) & (then.real < 0)
    apart = now.imag - then.imag
    share = np.divide(now.imag, apart, out=np.zeros_like(apart), where=apart != 0)
    size = np.where(crossed, np.abs(now.real + share * (then.real - now.real)), -1.0)
    largest = size.argmax(axis=1)
    row = np.arange(len(loop)), largest
    hertz = omega[largest] ** (1 - share[row]) * omega[largest + 1] ** share[row] / (2 * math.pi)
    return np.where(size[row] < 0, math.nan, size[row]), np.where(size[row] < 0, math.nan, hertz)


def pole_figure(loops: Sequence[OpenLoop]) -> go.Figure:
    figure = axes("real part of z", "imaginary part of z", 480)
    for loop in loops:
        name, look = _look(loops, loop)
        marker = {"color": look["color"], "symbol": "x" if loop.phase == "stick" else "circle-open", "size": 9}
        figure.add_scatter(x=loop.poles.real, y=loop.poles.imag, mode="markers", name=name, marker=marker)
    return _with_circle(figure, "solid").update_yaxes(scaleanchor="x")


def _with_circle(figure: go.Figure, dash: str) -> go.Figure:
    turn, look = np.linspace(0, 2 * math.pi, 200), {"color": MUTED, "width": 1, "dash": dash}
    return figure.add_scatter(
        x=np.cos(turn), y=np.sin(turn), mode="lines", line=look, showlegend=False, hoverinfo="skip"
    )


def run_figure(found: Study) -> go.Figure:
    figure = make_subplots(rows=1, cols=2, subplot_titles=[f"{1e3 * found.speed_m_s:g} mm/s", "stop and hold"])
    for number, (name, parts) in enumerate(found.runs.items()):
        for column, (part, run) in enumerate(parts.items(), start=1):
            error, look = 1e3 * (run.position - run.reference), {**line_look(number), "width": 1.2}
            line(figure, run.t, error, name, look, col=column, showlegend=part == "ramp", points=len(run.t) + 1)
    figure.update_xaxes(title="t in s")
    figure.update_yaxes(title="error in mm", row=1, col=1)
    return styled(figure, 380)
