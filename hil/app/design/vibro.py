"""`capsule design` for an inner-mass drive: resonances, gears, impact at each speed, the slow loop's margins."""

import math
from dataclasses import asdict
from typing import Any

import numpy as np
import plotly.graph_objects as go
from rich.table import Table

from controller.vibro.cycles import Cycles, VibroModel
from controller.vibro.drive_map import designed, speed_map
from controller.vibro.study import VibroStudy, vibro_study
from hil.app.console import text_table
from hil.app.design.page import Drawn, loop_figures, page_html
from hil.app.design.tables import MARGINS, TEXT, margin_numbers
from hil.report.theme import axes, line, line_look
from models.words.quantities import fixed, number


def study_of(model: VibroModel, delay_s: float, optimise: bool = True) -> VibroStudy:
    """The study with the controller's drive map, designed once for each model. Without `optimise` it has square waves
    alone.
    """
    if not 0 <= delay_s <= 0.2:
        raise ValueError(f"delay must lie in [0, 0.2] s; got {delay_s:g}")
    return vibro_study(model, designed(model, optimise), speed_map(Cycles(model)), delay_s)


def vibro_json(found: VibroStudy) -> dict[str, Any]:
    """What the study found, SI."""
    low, high = found.drive.reach()
    own = ("home_m_s", "slowest_m_s", "fastest_m_s", "impact")
    return {
        "delay_s": found.delay_s,
        "resonance": asdict(found.resonance),
        "reach_m_s": [low, high],
        "lag_s": found.drive.lag_s,
        "gears": [
            {**{name: getattr(gear, name) for name in own}, "period_s": gear.waveform(gear.home_m_s).period_s}
            for gear in found.drive.gears
        ],
        "ways": [
            {"commanded_m_s": speed, "shape": one.shape, "impact": one.impact, "speed_m_s": one.gait.speed_m_s}
            | {"period_s": one.waveform.period_s, "amplitude": max(one.waveform.levels)}
            | {"energy_J_per_m": one.gait.energy_J_per_m}
            for speed, waves in found.alternatives.items()
            for one in waves
        ],
        "slow_loops": [
            {"speed_m_s": one.speed_m_s, **asdict(one.loop.margins())}
            | {"slope_low": one.slope_low, "slope_high": one.slope_high, "holds": one.holds}
            for one in found.slow
        ],
    }


def vibro_lines(found: VibroStudy) -> list[str]:
    """Resonance, reach and gears, a line each."""
    own, (low, high) = found.resonance, found.drive.reach()
    resonance = TEXT("vibro.resonance", held=own.held_Hz, free=own.free_Hz, damping=own.damping)
    if math.isfinite(own.contact_s):
        resonance = TEXT("vibro.contact", resonance=resonance, contact=own.contact_s)
    gears = [
        TEXT(
            "vibro.gear",
            home=gear.home_m_s,
            slowest=gear.slowest_m_s,
            fastest=gear.fastest_m_s,
            period=gear.waveform(gear.home_m_s).period_s,
            impact=gear.impact,
        )
        for gear in found.drive.gears
    ]
    return [resonance, TEXT("vibro.reach", low=low, high=high, lag=found.drive.lag_s), *gears]


def vibro_tables(found: VibroStudy) -> tuple[Table, Table]:
    """Costs and margins."""
    return _cost_table(found), _loop_table(found)


def _cost_table(found: VibroStudy) -> Table:
    heads = ("mm/s", "", "impact", "mJ/mm", "period in ms", "duty", "amplitude", "goes at mm/s")
    table = text_table(TEXT("title.costs"), heads, ("", "impact"))
    for speed, waves in found.alternatives.items():
        for one in waves:
            wave = one.waveform
            duty = number(wave.edges[1], 3) if one.shape == "square" else ""
            cost = (number(x, 3) for x in (one.gait.energy_J_per_m, 1e3 * wave.period_s))
            rest = (number(x, 3) for x in (max(wave.levels), 1e3 * one.gait.speed_m_s))
            table.add_row(number(1e3 * speed), one.shape, one.impact, *cost, duty, *rest)
        if not waves:
            table.add_row(number(1e3 * speed), "out of reach", *[""] * 6)
    return table


def _loop_table(found: VibroStudy) -> Table:
    table = text_table(TEXT("title.slow", delay=found.delay_s), ("mm/s", *MARGINS, "bandwidth in Hz", "slope", "holds"))
    for one in found.slow:
        m = one.loop.margins()
        numbers = [number(x, 3) for x in (*margin_numbers(m), m.bandwidth_Hz)]
        slopes = f"{fixed(one.slope_low, 2)} to {fixed(one.slope_high, 2)}"
        table.add_row(number(1e3 * one.speed_m_s), *numbers, slopes, "yes" if one.holds else "NO")
    return table


def vibro_html(found: VibroStudy, name: str) -> str:
    """The page, complete in itself."""
    own = [Drawn("Square waves over their frequency", period_figure(found)), Drawn("Gears", gear_figure(found))]
    head = TEXT("title.vibro_page", name=name, delay=found.delay_s)
    return page_html(head, vibro_lines(found), vibro_tables(found), [*own, *loop_figures(found.loops)])


def period_figure(found: VibroStudy) -> go.Figure:
    """Mean speed of square waves over frequency at every amplitude of the map, at the best duty."""
    figure, table = axes("frequency in Hz", "mean speed in mm/s", 420), found.table
    for k, amplitude in enumerate(table.amplitude):
        speed = table.speed[:, :, k]
        best = np.take_along_axis(speed, np.abs(speed).argmax(axis=1)[:, None], axis=1)[:, 0]
        name = f"amplitude {amplitude:g}"
        line(figure, 1 / table.period_s, 1e3 * best, name, line_look(k), mode="lines+markers")
    return figure.add_vline(x=found.resonance.held_Hz, line={"dash": "dot", "width": 1})


def gear_figure(found: VibroStudy) -> go.Figure:
    """The waveform of every gear at its own speed."""
    figure = axes("t in ms", "share of the coil's force", 360)
    for k, gear in enumerate(found.drive.gears):
        wave = gear.waveform(gear.home_m_s)
        t = 1e3 * wave.period_s * np.asarray(wave.edges)
        name = f"{1e3 * gear.home_m_s:.3g} mm/s, impact {gear.impact}"
        line(figure, t, np.array([*wave.levels, wave.levels[-1]]), name, {"shape": "hv", **line_look(k)})
    return figure
