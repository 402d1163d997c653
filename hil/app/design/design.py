"""`capsule design`: the linearised rig, tuned PID and LQR on it, their margins with delay, and whether they hunt; for
an inner mass its resonance, gears and slow loop.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

from controller.design.study import Study, study
from controller.drives import INNER_MASS
from controller.model.control_model import control_model
from controller.vibro.cycles import VibroModel
from hil.app.console import output_to_notes, print_json, say, summary
from hil.app.design.page import design_html
from hil.app.design.tables import TEXT, balance_lines, command_unit, cycle_table, gains_json, margin_table, words_of
from hil.app.design.vibro import study_of, vibro_html, vibro_json, vibro_lines, vibro_tables
from hil.app.scenario.rig_file import read_deployed_rig
from hil.app.shared_options import Json, LearnedModel, Stage, argument, option
from hil.app.write import own_folder, write_files
from models.files.toml import check_word
from models.identification.finding import STAGES
from models.identification.model import read_model
from models.rigs.rig import Rig
from models.theta import Theta, spelled

PAGE = "design.html"
TICK_S = 0.002  # of the controller
SPEEDS_MM_S, LONGEST_DELAY_MS = (0.01, 100.0), 200.0  # that may be asked for, and the delay


def design(
    rig: Annotated[Path, argument("RIG.toml", "A rig of kind magnetic, coil or vibro.", "rig file")],
    model: LearnedModel = None,
    stage: Stage = "augmented",
    out: Annotated[Path | None, option("--out", "DIR", "Draw the plots into this folder.")] = None,
    speed_mm_s: Annotated[float, option("--speed", "MM_S", "Speed in mm/s to linearise at.")] = 1.0,
    delay_ms: Annotated[float, option("--delay", "MS", "Age of a measurement in ms when the command acts.")] = 15.0,
    json_output: Json = False,
) -> None:
    """Design for the rig of a file, with the numbers of a model where one is given."""
    belief = read_deployed_rig(rig)
    check_word(stage, "--stage", STAGES)
    values = Theta() if model is None else read_model(model, belief.kind).believed(stage)
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
                plant = control_model(belief, values, TICK_S, driven=_driven(belief))
                found = study(plant, 1e-3 * speed_mm_s, 1e-3 * delay_ms)
        if page is not None:
            write_files({page: vibro_html(shaken, title) if vibrates else design_html(found, plant, title)})
    if json_output:
        print_json((vibro_json(shaken) if vibrates else design_json(found, command_unit(plant))) | label)
        return
    console = summary()
    for line in vibro_lines(shaken) if vibrates else words_of(found, plant):
        console.print(line, soft_wrap=not vibrates)
    for table in vibro_tables(shaken) if vibrates else (margin_table(found), cycle_table(found)):
        console.print(table)
    for line in () if vibrates else balance_lines(found):
        console.print(line)
    say(TEXT("plots", page=page) if page else TEXT("no_plots"))


def _driven(belief: Rig) -> str:
    """The column that is commanded: a coil's voltage where the rig file has its resistance, else its current."""
    known = belief.coil is not None and belief.coil.coil_resistance_Ohm is not None
    return "coil_voltage_V" if known else ""


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
        "margins": [{"controller": loop.name, "phase": loop.phase, **vars(loop.margins())} for loop in found.loops],
        "cycles": {
            name: {
                part: {"peak_to_peak_m": c.peak_to_peak_m, "period_s": c.period_s, "rms_m": c.rms_m, "hunts": c.hunts}
                for part, c in parts.items()
            }
            for name, parts in cycles.items()
        },
        "harmonic_balance": {name: [asdict(cycle) for cycle in found.balances()[name]] for name in found.laws()},
    }
