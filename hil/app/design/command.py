"""`capsule design`: the linearised rig, tuned PID and LQR on it, their margins with delay, and whether they hunt; for
an inner mass its resonance, gears and slow loop.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from controller.design.margins import Margins
from controller.design.study import Study, study
from controller.model.control_model import ControlModel, control_model
from controller.vibro.cycles import VibroModel
from hil.app.console import output_to_notes, print_json, summary
from hil.app.design.gains import command_unit, gains_json
from hil.app.design.page import design_html
from hil.app.design.tables import balance_lines, cycle_table, margin_table, words_of
from hil.app.design.vibro import print_vibro, study_of, vibro_html, vibro_json
from hil.app.scenario.deployment import read_deployed_rig
from hil.app.write import write_files
from models.files.rig import Rig
from models.identification.finding import STAGES
from models.identification.model import read_model
from models.parameter import nearest
from models.theta import Theta, spelled

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
    belief = read_deployed_rig(rig)
    values = _values(belief, model, stage)
    if not 0 <= delay_ms <= LONGEST_DELAY_MS:
        raise ValueError(f"--delay must lie in [0, {LONGEST_DELAY_MS:g}] ms; got {delay_ms:g}")
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
    _hand_over(
        page, lambda: design_html(found, plant, title), json_output, design_json(found, command_unit(plant)) | label
    )
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


def _values(belief: Rig, model: Path | None, stage: str) -> Theta:
    if stage not in STAGES:
        raise ValueError(f"--stage must be one of {', '.join(STAGES)}; got {stage!r}; {nearest(stage, STAGES)}")
    return Theta() if model is None else read_model(model, belief.kind).believed(stage)


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
                "states": [*map(spelled, plant.states)],
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
    for line in words_of(found, plant):
        console.print(line, markup=False, soft_wrap=True)
    console.print(margin_table(found))
    console.print(cycle_table(found))
    for line in balance_lines(found):
        console.print(line, markup=False)
    if page is not None:
        console.print(f"plots: {page}", markup=False, soft_wrap=True)
