"""The design's plots as one page: Bode, Nyquist, sensitivity, poles, and the loop on set-valued friction."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

import hil.app.report
from controller.design.margins import Loop
from controller.design.study import Study
from hil.app.report.theme import INK, MUTED, QUANTITY_COLOURS, figure_html, line_colour, styled

STYLE = Path(hil.app.report.__file__).with_name("style.css")


def design_html(found: Study, title: str) -> str:
    """The page, complete in itself."""
    head = f"Design for {title}: sliding at {1e3 * found.speed_m_s:g} mm/s, {1e3 * found.delay_s:g} ms of delay"
    own = {"Stick and slip": run_figure(found), "Harmonic balance": balance_figure(found)}
    return page_html(head, loop_figures(found.loops) | own)


def loop_figures(loops: Sequence[Loop]) -> dict[str, go.Figure]:
    """What is drawn of linear loops, by heading."""
    return {
        "Open loop (Bode)": bode_figure(loops),
        "Open loop (Nyquist)": nyquist_figure(loops),
        "Sensitivity": sensitivity_figure(loops),
        "Closed-loop poles": pole_figure(loops),
    }


def page_html(head: str, figures: Mapping[str, go.Figure]) -> str:
    """A page of figures under their headings."""
    body = "".join(
        f'<section><h2>{escape(name)}</h2><div class="figure">{figure_html(figure, f"figure-{i}")}</div></section>'
        for i, (name, figure) in enumerate(figures.items())
    )
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(head)}</title>'
        f"<style>{STYLE.read_text(encoding='utf-8')}</style><script>{get_plotlyjs()}</script></head>"
        f"<body><main><header><h1>{escape(head)}</h1></header>{body}</main></body></html>\n"
    )


def _look(loops: Sequence[Loop], loop: Loop) -> dict[str, object]:
    names = list(dict.fromkeys(item.name for item in loops))
    dash = "solid" if loop.phase == "stick" else "dash"
    return {"color": line_colour(names.index(loop.name)), "dash": dash}


def bode_figure(loops: Sequence[Loop]) -> go.Figure:
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


def nyquist_figure(loops: Sequence[Loop]) -> go.Figure:
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
    styled(figure, 520)
    figure.update_xaxes(title="real part", range=[-3, 2])
    return figure.update_yaxes(title="imaginary part", range=[-3, 2], scaleanchor="x")


def sensitivity_figure(loops: Sequence[Loop]) -> go.Figure:
    """What each loop makes of a disturbance: below 0 dB it is damped."""
    figure = go.Figure()
    for loop in loops:
        values, label = 20 * np.log10(loop.sensitivity()), f"{loop.name}, {loop.phase}"
        figure.add_scatter(x=loop.omega / (2 * math.pi), y=values, mode="lines", name=label, line=_look(loops, loop))
    styled(figure, 380)
    figure.update_xaxes(title="frequency in Hz", type="log")
    return figure.update_yaxes(title="|1/(1 + L)| in dB")


def balance_figure(found: Study) -> go.Figure:
    """Where a force takes the capsule, G, and -1/N of stick and slip along the amplitude: a cycle stands where they
    meet at one frequency.
    """
    figure = go.Figure()
    wall, hertz = found.wall, found.wall.omega / (2 * math.pi)
    for place, name in enumerate(found.laws()):
        G = 1e3 * found.compliance(name)
        line = {"color": QUANTITY_COLOURS[place]}
        texts = [f"{f:.3g} Hz" for f in hertz]
        figure.add_scatter(x=G.real, y=G.imag, mode="lines+markers", name=f"G, {name}", line=line, text=texts)
    for column in range(0, len(hertz), 6):
        across = -1e3 / wall.N[:, column]
        texts = [f"{1e3 * A:.3g} mm" for A in wall.amplitude_m]
        line, label = {"color": MUTED, "dash": "dot"}, f"-1/N, {hertz[column]:.2g} Hz"
        figure.add_scatter(x=across.real, y=across.imag, mode="lines", name=label, line=line, text=texts)
    for place, (name, cycles) in enumerate(found.balances().items()):
        across = np.array([-1e3 / found.wall.at(c.amplitude_m, c.frequency_Hz) for c in cycles], dtype=complex)
        marker = {"color": QUANTITY_COLOURS[place], "symbol": "x", "size": 11}
        figure.add_scatter(x=across.real, y=across.imag, mode="markers", name=f"balance, {name}", marker=marker)
    styled(figure, 520)
    figure.update_xaxes(title="real part in mm/N", range=[-60, 60])
    return figure.update_yaxes(title="imaginary part in mm/N", range=[-60, 60], scaleanchor="x")


def pole_figure(loops: Sequence[Loop]) -> go.Figure:
    """Poles of the closed loops in the discrete plane; stable inside the circle."""
    figure = go.Figure()
    for loop in loops:
        look = _look(loops, loop)
        marker = {"color": look["color"], "symbol": "x" if loop.phase == "stick" else "circle-open", "size": 9}
        name = f"{loop.name}, {loop.phase}"
        figure.add_scatter(x=loop.poles.real, y=loop.poles.imag, mode="markers", name=name, marker=marker)
    turn = np.linspace(0, 2 * math.pi, 200)
    figure.add_scatter(
        x=np.cos(turn), y=np.sin(turn), mode="lines", line={"color": MUTED, "width": 1}, showlegend=False
    )
    styled(figure, 480)
    figure.update_xaxes(title="real part")
    return figure.update_yaxes(title="imaginary part", scaleanchor="x")


def run_figure(found: Study) -> go.Figure:
    """Position error of every controller on set-valued friction: slow motion and hold."""
    figure = make_subplots(rows=1, cols=2, subplot_titles=[f"{1e3 * found.speed_m_s:g} mm/s", "stop and hold"])
    for place, (name, parts) in enumerate(found.runs.items()):
        for column, (part, run) in enumerate(parts.items(), start=1):
            error, line = 1e3 * (run.position - run.reference), {"color": QUANTITY_COLOURS[place], "width": 1.2}
            shown = part == "ramp"
            figure.add_scatter(
                x=run.t, y=error, mode="lines", name=name, line=line, showlegend=shown, row=1, col=column
            )
    figure.update_xaxes(title="t in s")
    figure.update_yaxes(title="error in mm", row=1, col=1)
    return styled(figure, 380)
