"""The design's plots as one page: Bode, Nyquist, sensitivity, poles, and the loop on set-valued friction."""

import math
from collections.abc import Mapping, Sequence
from html import escape

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots
from rich.table import Table

from controller.design.margins import Complex, OpenLoop
from controller.design.study import Study
from controller.model.control_model import ControlModel
from controller.signals import Array
from hil.app.design.tables import balance_lines, cycle_table, margin_table, words_of
from hil.app.report.document import document, heading, mixed_table
from hil.app.report.theme import INK, MUTED, axes, figure_html, line_colour, line_look, styled
from hil.app.report.words import signed

Figures = Mapping[str, tuple[str, go.Figure]]


def design_html(found: Study, plant: ControlModel, title: str) -> str:
    """The page, complete in itself."""
    head = f"Design for {title}: sliding at {1e3 * found.speed_m_s:g} mm/s, {1e3 * found.delay_s:g} ms of delay"
    numbers = listed_html(words_of(found, plant)) + table_html(margin_table(found)) + table_html(cycle_table(found))
    balance = listed_html(balance_lines(found)) + (
        "<p>The loop of friction and controller at the frequency where its phase is −180°, over the amplitude of a"
        " swing about rest. Where a line crosses 0 dB a cycle can stand (cross); a line that stays below has none.</p>"
    )
    own = {"Stick and slip": ("", run_figure(found)), "Harmonic balance": (balance, balance_figure(found))}
    return page_html(head, numbers, loop_figures(found.loops) | own)


def loop_figures(loops: Sequence[OpenLoop]) -> dict[str, tuple[str, go.Figure]]:
    """What is drawn of linear loops, by heading: words and figure."""
    return {
        "Open loop (Bode)": ("", bode_figure(loops)),
        "Open loop (Nyquist)": ("", nyquist_figure(loops)),
        "Sensitivity": ("", sensitivity_figure(loops)),
        "Closed-loop poles": ("", pole_figure(loops)),
    }


def page_html(head: str, numbers: str, figures: Figures) -> str:
    """A page of numbers, then figures under their headings with words in HTML before them."""
    sections = [("numbers", "Numbers", numbers)]
    sections += [
        (f"section-{i}", name, words + figure_html(figure, f"figure-{i}"))
        for i, (name, (words, figure)) in enumerate(figures.items())
    ]
    return document(head, heading("Design", head), sections)


def table_html(table: Table) -> str:
    """A table of the terminal on the page."""
    columns = table.columns
    head = [(escape(str(column.header)), column.justify == "left") for column in columns]
    rows = zip(*([escape(signed(str(cell))) for cell in column.cells] for column in columns), strict=True)
    title = f"<h3>{escape(str(table.title))}</h3>" if table.title else ""
    return title + mixed_table(head, rows)


def listed_html(lines: Sequence[str]) -> str:
    """Lines of the terminal on the page."""
    return f"<ul>{''.join(f'<li>{escape(signed(line.strip()))}</li>' for line in lines)}</ul>"


def _look(loops: Sequence[OpenLoop], loop: OpenLoop) -> dict[str, object]:
    names = list(dict.fromkeys(item.name for item in loops))
    dash = "solid" if loop.phase == "stick" else "dash"
    return {"color": line_colour(names.index(loop.name)), "dash": dash}


def bode_figure(loops: Sequence[OpenLoop]) -> go.Figure:
    """Gain and phase of every open loop, delay included."""
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for loop in loops:
        hertz, label = loop.omega / (2 * math.pi), f"{loop.name}, {loop.phase}"
        phase = np.degrees(np.unwrap(np.angle(loop.L)))
        for row, values in ((1, 20 * np.log10(np.abs(loop.L))), (2, phase - 360 * (phase[0] > 90))):
            line, shown = _look(loops, loop), row == 1
            figure.add_scatter(x=hertz, y=values, mode="lines", name=label, line=line, showlegend=shown, row=row, col=1)
    figure.add_hline(y=0, line={"color": MUTED, "width": 1}, row=1, col=1)
    figure.add_hline(y=-180, line={"color": MUTED, "width": 1}, row=2, col=1)
    figure.update_xaxes(type="log")
    figure.update_xaxes(title="frequency in Hz", row=2, col=1)
    figure.update_yaxes(title="|L| in dB", row=1, col=1)
    figure.update_yaxes(title="phase in deg", range=[-360, 0], row=2, col=1)
    return styled(figure, 520)


def nyquist_figure(loops: Sequence[OpenLoop]) -> go.Figure:
    """Every open loop near -1."""
    figure = go.Figure()
    for loop in loops:
        near = np.abs(loop.L) < 6
        label = f"{loop.name}, {loop.phase}"
        figure.add_scatter(x=loop.L.real[near], y=loop.L.imag[near], mode="lines", name=label, line=_look(loops, loop))
    turn = np.linspace(0, 2 * math.pi, 200)
    circle = {"color": MUTED, "width": 1, "dash": "dot"}
    figure.add_scatter(x=np.cos(turn), y=np.sin(turn), mode="lines", line=circle, showlegend=False, hoverinfo="skip")
    figure.add_scatter(x=[-1], y=[0], mode="markers", marker={"color": INK, "symbol": "x", "size": 9}, showlegend=False)
    axes(figure, "real part", "imaginary part", 520).update_xaxes(range=[-3, 2])
    return figure.update_yaxes(range=[-3, 2], scaleanchor="x")


def sensitivity_figure(loops: Sequence[OpenLoop]) -> go.Figure:
    """What each loop makes of a disturbance: below 0 dB it is damped."""
    figure = go.Figure()
    for loop in loops:
        values, label = 20 * np.log10(loop.sensitivity()), f"{loop.name}, {loop.phase}"
        figure.add_scatter(x=loop.omega / (2 * math.pi), y=values, mode="lines", name=label, line=_look(loops, loop))
    return axes(figure, "frequency in Hz", "|1/(1 + L)| in dB", 380).update_xaxes(type="log")


def balance_figure(found: Study) -> go.Figure:
    """Gain of friction and controller where their phase is -180 deg, and that frequency, over the amplitude; the cycles
    that the harmonic balance finds stand at 0 dB.
    """
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06, row_heights=[0.6, 0.4])
    amplitude = 1e3 * found.wall.amplitude_m
    for place, name in enumerate(found.laws()):
        gain, hertz = crossings(found.wall.N * found.compliance(name), found.wall.omega)
        for row, values in ((1, 20 * np.log10(gain)), (2, hertz)):
            figure.add_scatter(
                x=amplitude, y=values, mode="lines+markers", name=name, line=line_look(place), marker={"size": 4},
                showlegend=row == 1, legendgroup=name, row=row, col=1,
            )  # fmt: skip
    for place, (name, cycles) in enumerate(found.balances().items()):
        marker = {"color": line_colour(place), "symbol": "x", "size": 12}
        at = [1e3 * cycle.amplitude_m for cycle in cycles]
        words = ["hunts" if cycle.stable else "goes off from more" for cycle in cycles]
        for row, heights in ((1, [0.0] * len(at)), (2, [cycle.frequency_Hz for cycle in cycles])):
            if at:
                figure.add_scatter(
                    x=at, y=heights, mode="markers", name=f"cycle, {name}", marker=marker, text=words,
                    showlegend=row == 1, legendgroup=f"cycle {name}", row=row, col=1,
                )  # fmt: skip
    figure.add_hline(y=0, line={"color": MUTED, "width": 1}, row=1, col=1)
    figure.update_xaxes(type="log")
    figure.update_xaxes(title="amplitude in mm", row=2, col=1)
    figure.update_yaxes(title="|N G| in dB", row=1, col=1)
    figure.update_yaxes(title="frequency in Hz", type="log", row=2, col=1)
    return styled(figure, 520)


def crossings(loop: Complex, omega: Array) -> tuple[Array, Array]:
    """The largest gain at a phase of -180 deg and its frequency in Hz for each row of `loop` (a, w) over `omega` (w,);
    NaN where the phase is never that.
    """
    gain, hertz = (np.full(len(loop), math.nan) for _ in range(2))
    for i, row in enumerate(loop):
        at = np.flatnonzero((row.imag[:-1] * row.imag[1:] <= 0) & (row.real[:-1] < 0) & (row.real[1:] < 0))
        for j in at:
            share = row.imag[j] / (row.imag[j] - row.imag[j + 1]) if row.imag[j] != row.imag[j + 1] else 0.0
            size = abs(row.real[j] + share * (row.real[j + 1] - row.real[j]))
            if not size <= gain[i]:
                gain[i] = size
                hertz[i] = omega[j] ** (1 - share) * omega[j + 1] ** share / (2 * math.pi)
    return gain, hertz


def pole_figure(loops: Sequence[OpenLoop]) -> go.Figure:
    """Poles of the closed loops in the discrete plane; stable inside the circle."""
    figure = go.Figure()
    for loop in loops:
        look = _look(loops, loop)
        marker = {"color": look["color"], "symbol": "x" if loop.phase == "stick" else "circle-open", "size": 9}
        name = f"{loop.name}, {loop.phase}"
        figure.add_scatter(x=loop.poles.real, y=loop.poles.imag, mode="markers", name=name, marker=marker)
    turn, line = np.linspace(0, 2 * math.pi, 200), {"color": MUTED, "width": 1}
    figure.add_scatter(x=np.cos(turn), y=np.sin(turn), mode="lines", line=line, showlegend=False)
    return axes(figure, "real part", "imaginary part", 480).update_yaxes(scaleanchor="x")


def run_figure(found: Study) -> go.Figure:
    """Position error of every controller on set-valued friction: slow motion and hold."""
    figure = make_subplots(rows=1, cols=2, subplot_titles=[f"{1e3 * found.speed_m_s:g} mm/s", "stop and hold"])
    for place, (name, parts) in enumerate(found.runs.items()):
        for column, (part, run) in enumerate(parts.items(), start=1):
            error, line = 1e3 * (run.position - run.reference), {**line_look(place), "width": 1.2}
            look = {"mode": "lines", "name": name, "line": line, "showlegend": part == "ramp"}
            figure.add_scatter(x=run.t, y=error, row=1, col=column, **look)
    figure.update_xaxes(title="t in s")
    figure.update_yaxes(title="error in mm", row=1, col=1)
    return styled(figure, 380)
