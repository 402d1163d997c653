"""`capsule design`: the linearised rig, tuned PID and LQR on it, their margins with delay, and whether they hunt; for
an inner mass its resonance, gears and slow loop.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.table import Table

from controller.design.describing_function import AMPLITUDES_M, Balance
from controller.design.margins import Margins
from controller.design.study import Study, study
from controller.model.control_model import ControlModel, control_model
from controller.vibro.cycles import VibroModel
from hil.app.console import output_to_notes, print_json, summary
from hil.app.design.gains import command_unit, gains_json, gains_words
from hil.app.design.page import design_html
from hil.app.design.vibro import print_vibro, study_of, vibro_html, vibro_json
from hil.app.write import check_folder, write_files
from models.files.rig import Rig, read_rig
from models.identification.finding import STAGES
from models.identification.model import read_model
from models.parameter import nearest

PAGE = "design.html"
TICK_S = 0.002
SPEEDS_MM_S, LONGEST_DELAY_MS = (0.01, 100.0), 200.0


def design(
    rig: Path,
    model: Path | None = None,
    out: Path | None = None,
    *,
    stage: str = "augmented",
    speed_mm_s: float = 1.0,
    delay_ms: float = 15.0,
    json_output: bool = False,
) -> None:
    """Design for the rig of a file, with the numbers of a model that close-loop wrote where one is given; draw into
    `out`.
    """
    belief = read_rig(rig)
    values = _values(belief, model, stage)
    if not 0 <= delay_ms <= LONGEST_DELAY_MS:
        raise ValueError(f"--delay must lie in [0, {LONGEST_DELAY_MS:g}] ms; got {delay_ms:g}")
    if out is not None:
        check_folder(out, "--out")
    label = {"rig": str(rig), "model": stage if model else "nominal", "page": None if out is None else str(out / PAGE)}
    title, page = belief.name or rig.stem, None if out is None else out / PAGE
    if belief.kind == "vibro":
        with output_to_notes():
            shaken = study_of(VibroModel.from_rig(belief, values), 1e-3 * delay_ms)
        _hand_over(page, lambda: vibro_html(shaken, title), json_output, vibro_json(shaken) | label)
        if not json_output:
            print_vibro(shaken, page)
            _hint(page)
        return
    if not SPEEDS_MM_S[0] <= abs(speed_mm_s) <= SPEEDS_MM_S[1]:
        raise ValueError(f"--speed must lie in [{SPEEDS_MM_S[0]:g}, {SPEEDS_MM_S[1]:g}] mm/s; got {speed_mm_s:g}")
    with output_to_notes():
        plant = control_model(belief, values, TICK_S, driven=_driven(belief))
        found = study(plant, 1e-3 * speed_mm_s, 1e-3 * delay_ms)
    _hand_over(page, lambda: design_html(found, title), json_output, design_json(found, command_unit(plant)) | label)
    if not json_output:
        print_design(found, plant, page)
        _hint(page)


def _driven(belief: Rig) -> str:
    """The column that track, sil and run command: a coil's voltage where the rig file has its resistance, else the
    current.
    """
    known = belief.coil is not None and belief.coil.coil_resistance_Ohm is not None
    return "coil_voltage_V" if known else ""


def _hint(page: Path | None) -> None:
    if page is None:
        summary().print("no plots drawn: --out DIR draws them", markup=False)


def _hand_over(page: Path | None, html: Callable[[], str], json_output: bool, numbers: dict[str, Any]) -> None:
    """Write the page and the JSON, where asked for."""
    if page is not None:
        write_files({page: html()})
    if json_output:
        print_json(numbers)


def _values(belief: Rig, model: Path | None, stage: str) -> dict[str, float]:
    if stage not in STAGES:
        raise ValueError(f"--stage must be one of {', '.join(STAGES)}; got {stage!r}; {nearest(stage, STAGES)}")
    return {} if model is None else read_model(model, belief.kind).believed(stage)


def design_json(found: Study, unit: str) -> dict[str, Any]:
    """What the design found, SI; `unit` is the command's."""
    cycles = found.cycles()
    return {
        "speed_m_s": found.speed_m_s,
        "delay_s": found.delay_s,
        "tick_s": found.plants[0].tick_s,
        "plants": {
            plant.phase: {
                "command": plant.command,
                "states": list(plant.states),
                "poles_1_per_s": [[rate.real, rate.imag] for rate in plant.rates()],
            }
            for plant in found.plants
        },
        "gains": gains_json(found.pid, found.lqr, unit),
        "margins": [
            {"controller": loop.name, "phase": loop.phase, **_margins_json(loop.margins())} for loop in found.loops
        ],
        "cycles": {
            name: {
                part: {"peak_to_peak_m": c.peak_to_peak_m, "period_s": c.period_s, "rms_m": c.rms_m, "hunts": c.hunts}
                for part, c in parts.items()
            }
            for name, parts in cycles.items()
        },
        "harmonic_balance": {name: [asdict(cycle) for cycle in found.balances()[name]] for name in found.laws()},
    }


def _margins_json(margins: Margins) -> dict[str, Any]:
    return {name: getattr(margins, name) for name in Margins.__dataclass_fields__}


def print_design(found: Study, plant: ControlModel, page: Path | None) -> None:
    """Poles, gains, margins and cycles as tables."""
    console = summary()
    for linear in found.plants:
        poles = ", ".join(_complex(rate) for rate in linear.rates())
        console.print(
            f"sliding at {1e3 * found.speed_m_s:g} mm/s, wall in {linear.phase}: poles {poles} 1/s", markup=False
        )
    for line in gains_words(found.pid, found.lqr, plant):
        console.print(line, markup=False, soft_wrap=True)
    console.print(_margin_table(found))
    console.print(_cycle_table(found))
    for name, balance in found.balances().items():
        console.print(f"harmonic balance, {name} at rest: {balance_words(balance)}", markup=False)
    if page is not None:
        console.print(f"plots: {page}", markup=False, soft_wrap=True)


def balance_words(found: list[Balance]) -> str:
    """What the harmonic balance of one loop says."""
    if not found:
        return f"no cycle from {1e3 * AMPLITUDES_M[0]:g} to {1e3 * AMPLITUDES_M[-1]:g} mm: stiction brings it to rest"
    return "; ".join(
        (
            f"hunts at {1e3 * one.amplitude_m:.3g} mm, {one.frequency_Hz:.3g} Hz"
            if one.stable
            else (
                f"comes to rest from a swing below {1e3 * one.amplitude_m:.3g} mm ({one.frequency_Hz:.3g} Hz), goes off"
                " from more"
            )
        )
        for one in found
    )


def _complex(rate: complex) -> str:
    return f"{rate.real:.4g}" if rate.imag == 0 else f"{rate.real:.4g}{rate.imag:+.4g}j"


def _margin_table(found: Study) -> Table:
    table = Table(title=f"margins with {1e3 * found.delay_s:g} ms of delay", title_justify="left")
    for column in (
        "",
        "wall",
        "gain",
        "phase in deg",
        "more delay in ms",
        "sensitivity",
        "crossover in Hz",
        "bandwidth in Hz",
        "stable",
    ):
        table.add_column(column, justify="left" if column in ("", "wall") else "right")
    for loop in found.loops:
        m = loop.margins()
        numbers = (m.gain, m.phase_deg, 1e3 * m.delay_s, m.sensitivity_peak, m.crossover_Hz, m.bandwidth_Hz)
        table.add_row(
            loop.name,
            loop.phase,
            *(f"{x:.3g}" if math.isfinite(x) else "-" for x in numbers),
            "yes" if m.stable else "NO",
        )
    return table


def _cycle_table(found: Study) -> Table:
    table = Table(title="set-valued friction, no noise: error in the last half", title_justify="left")
    for column in ("", "run", "peak to peak in um", "period in s", "rms in um", "hunts"):
        table.add_column(column, justify="left" if column in ("", "run") else "right")
    for name, parts in found.cycles().items():
        for part, c in parts.items():
            period = f"{c.period_s:.3g}" if math.isfinite(c.period_s) else "-"
            table.add_row(
                name, part, f"{1e6 * c.peak_to_peak_m:.3g}", period, f"{1e6 * c.rms_m:.3g}", "yes" if c.hunts else "no"
            )
    return table
