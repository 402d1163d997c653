"""`capsule design`: the linearised rig, PID and LQR, margins, hunting; of an inner mass resonance, gears, slow loop."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import plotly.graph_objects as go
from rich.table import Table
from rich.text import Text

from controller.design.study import Study, study
from controller.drives import INNER_MASS
from controller.model.control_model import control_model
from controller.vibro.cycles import Cycles, VibroModel
from controller.vibro.drive_map import designed, speed_map
from controller.vibro.study import VibroStudy, vibro_study
from hil.app.console import answer, output_to_notes, text_table
from hil.app.design import tables
from hil.app.design.page import Drawn, design_html, loop_figures, page_html
from hil.app.design.tables import TEXT
from hil.app.scenario.model_use import values_of
from hil.app.scenario.rig_file import read_deployed_rig
from hil.app.shared_options import Json, LearnedModel, Stage, argument, option
from hil.app.write import own_folder, write_files
from hil.report.theme import axes, line, line_look
from models.files.toml import check_word
from models.identification.finding import STAGES
from models.identification.model import read_model
from models.theta import Theta, spelled
from models.words.quantities import fixed, number

PAGE = "design.html"
TICK_S = 0.002  # of the controller
SPEEDS_MM_S, LONGEST_DELAY_MS = (0.01, 100.0), 200.0  # that may be asked for, and the delay


def design(
    rig: Annotated[Path, argument("RIG.toml", reads="rig file")],
    model: LearnedModel = None,
    stage: Stage = "augmented",
    out: Annotated[Path | None, option("--out", "DIR")] = None,
    speed_mm_s: Annotated[float, option("--speed", "MM_S")] = 1.0,
    delay_ms: Annotated[float, option("--delay", "MS")] = 15.0,
    json_output: Json = False,
) -> None:
    belief = read_deployed_rig(rig)
    check_word(stage, "--stage", STAGES)
    values = Theta() if model is None else values_of(model, read_model(model, belief.kind), stage)[0]
    if not 0 <= delay_ms <= LONGEST_DELAY_MS:
        raise ValueError(f"--delay must lie in [0, {LONGEST_DELAY_MS:g}] ms; got {delay_ms:g}")
    title, page = belief.name or rig.stem, None if out is None else out / PAGE
    label = {"rig": str(rig), "model": stage if model else "nominal", "page": page and str(page)}
    vibrates = belief.kind == INNER_MASS.name
    if not vibrates and not SPEEDS_MM_S[0] <= abs(speed_mm_s) <= SPEEDS_MM_S[1]:
        raise ValueError(f"--speed must lie in [{SPEEDS_MM_S[0]:g}, {SPEEDS_MM_S[1]:g}] mm/s; got {speed_mm_s:g}")
    with own_folder(out, "--out"):
        with output_to_notes():
            if vibrates:
                shaken = study_of(VibroModel.from_rig(belief, values), 1e-3 * delay_ms)
            else:
                # a coil is commanded by its voltage where the rig file has its resistance, else by its current
                known = belief.coil is not None and belief.coil.coil_resistance_Ohm is not None
                plant = control_model(belief, values, TICK_S, driven="coil_voltage_V" if known else "")
                found = study(plant, 1e-3 * speed_mm_s, 1e-3 * delay_ms)
        if page is not None:
            write_files({page: vibro_html(shaken, title) if vibrates else design_html(found, plant, title)})
    lines: list[Any]
    if vibrates:
        document, lines = vibro_json(shaken), [*map(Text, vibro_lines(shaken)), *vibro_tables(shaken)]
    else:
        document, below = design_json(found, tables.command_unit(plant)), map(Text, tables.balance_lines(found))
        lines = [*tables.words_of(found, plant), tables.margin_table(found), tables.cycle_table(found), *below]
    answer(json_output, document | label, *lines, TEXT("plots", page=page) if page else TEXT("no_plots"))


def design_json(found: Study, unit: str) -> dict[str, Any]:
    """What the design found, SI; `unit` is the command's."""
    return {
        "speed_m_s": found.speed_m_s,
        "delay_s": found.delay_s,
        "tick_s": found.plants[0].tick_s,
        "plants": {
            plant.phase: {
                "command": plant.command,
                "states": [*map(spelled, plant.states)],
                "poles_1_per_s": [[rate.real, rate.imag] for rate in plant.rates()],
            }
            for plant in found.plants
        },
        "gains": tables.gains_json(found.pid, found.lqr, unit),
        "margins": [{"controller": loop.name, "phase": loop.phase, **vars(loop.margins())} for loop in found.loops],
        "cycles": {
            name: {part: {**asdict(cycle), "hunts": cycle.hunts} for part, cycle in parts.items()}
            for name, parts in found.cycles().items()
        },
        "harmonic_balance": {name: [asdict(cycle) for cycle in found.balances()[name]] for name in found.laws()},
    }


def study_of(model: VibroModel, delay_s: float, optimise: bool = True) -> VibroStudy:
    """The study with the controller's drive map; without `optimise` it has square waves alone."""
    if not 0 <= delay_s <= 0.2:
        raise ValueError(f"delay must lie in [0, 0.2] s; got {delay_s:g}")
    return vibro_study(model, designed(model, optimise), speed_map(Cycles(model)), delay_s)


def vibro_json(found: VibroStudy) -> dict[str, Any]:
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
    own, (low, high) = found.resonance, found.drive.reach()
    resonance = TEXT("vibro.resonance", own=own)
    if math.isfinite(own.contact_s):
        resonance = TEXT("vibro.contact", resonance=resonance, contact=own.contact_s)
    gears = (TEXT("vibro.gear", gear=one, home=one.waveform(one.home_m_s)) for one in found.drive.gears)
    return [resonance, TEXT("vibro.reach", low=low, high=high, lag=found.drive.lag_s), *gears]


def vibro_tables(found: VibroStudy) -> tuple[Table, Table]:
    heads = ("mm/s", "", "impact", "mJ/mm", "period in ms", "duty", "amplitude", "goes at mm/s")
    costs = text_table(TEXT("title.costs"), heads, ("", "impact"))
    for speed, waves in found.alternatives.items():
        for one in waves:
            wave = one.waveform
            duty = number(wave.edges[1], 3) if one.shape == "square" else ""
            cost = (number(x, 3) for x in (one.gait.energy_J_per_m, 1e3 * wave.period_s))
            rest = (number(x, 3) for x in (max(wave.levels), 1e3 * one.gait.speed_m_s))
            costs.add_row(number(1e3 * speed), one.shape, one.impact, *cost, duty, *rest)
        if not waves:
            costs.add_row(number(1e3 * speed), "out of reach", *[""] * 6)
    heads = ("mm/s", *tables.MARGINS, "bandwidth in Hz", "slope", "holds")
    margins = text_table(TEXT("title.slow", delay=found.delay_s), heads)
    for slow in found.slow:
        m = slow.loop.margins()
        numbers = [number(x, 3) for x in (*tables.margin_numbers(m), m.bandwidth_Hz)]
        slopes = f"{fixed(slow.slope_low, 2)} to {fixed(slow.slope_high, 2)}"
        margins.add_row(number(1e3 * slow.speed_m_s), *numbers, slopes, "yes" if slow.holds else "NO")
    return costs, margins


def vibro_html(found: VibroStudy, name: str) -> str:
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
    figure = axes("t in ms", "share of the coil's force", 360)
    for k, gear in enumerate(found.drive.gears):
        wave = gear.waveform(gear.home_m_s)
        t = 1e3 * wave.period_s * np.asarray(wave.edges)
        name = f"{1e3 * gear.home_m_s:.3g} mm/s, impact {gear.impact}"
        line(figure, t, np.array([*wave.levels, wave.levels[-1]]), name, {"shape": "hv", **line_look(k)})
    return figure
