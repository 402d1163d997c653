"""What a design found in words and tables, for terminal and page alike: poles, gains, margins, cycles."""

from typing import Any, Final

from rich.table import Table

from controller.baselines import Gains, lqr_gains
from controller.design.describing_function import AMPLITUDES_M
from controller.design.study import Study
from controller.design.tuning import Margins, Pid
from controller.drives import driven_of
from controller.model.control_model import ControlModel
from controller.model.linear import linearise
from hil.app.console import text_table
from models.theta import spelled
from models.words.quantities import number
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
MARGINS: Final = ("gain", "phase in deg", "more delay in ms", "sensitivity")


def words_of(found: Study, plant: ControlModel) -> list[str]:
    """The poles, the designed gains, and those that track, sil and run have."""
    pid, unit, drive = found.pid, command_unit(plant), driven_of(plant.drive)
    own = {"command": plant.drive.commanded, "unit": unit, "filter": pid.filter_s}
    pids = {"pid": drive.pid, "pid_friction": drive.pid_friction, TEXT("fallbacks"): drive.pid_estimated}
    running = _feedback(lqr_gains(linearise(plant, "slip")), unit)
    return [
        *(
            TEXT("poles", speed=found.speed_m_s, phase=linear.phase, poles=", ".join(map(_complex, linear.rates())))
            for linear in found.plants
        ),
        TEXT("pid", pid=pid, **own),
        TEXT("lqr", feedback=_feedback(found.lqr, unit)),
        TEXT("others"),
        *(f"  {TEXT('running_pid', name=name, gains=gains)}" for name, gains in pids.items()),
        f"  {TEXT('running_lqr', feedback=running, tick=plant.tick_s)}",
    ]


def balance_lines(found: Study) -> list[str]:
    none = TEXT("balance.none", low=float(AMPLITUDES_M[0]), high=float(AMPLITUDES_M[-1]))
    lines = []
    for name, cycles in found.balances().items():
        words = "; ".join(TEXT(f"balance.{'hunts' if one.stable else 'rests'}", cycle=one) for one in cycles)
        lines.append(TEXT("balance.line", name=name, words=words or none))
    return lines


def _complex(rate: complex) -> str:
    imaginary = f" {'+' if rate.imag > 0 else '−'} {number(abs(rate.imag))}j" if rate.imag else ""
    return f"{number(rate.real)}{imaginary}"


def margin_table(found: Study) -> Table:
    """Gain, phase and delay margins of each loop, a row for a loop and state of the wall."""
    heads = ("", "wall", *MARGINS, "crossover in Hz", "bandwidth in Hz", "stable")
    table = text_table(TEXT("title.margins", delay=found.delay_s), heads, ("", "wall"))
    for loop in found.loops:
        m = loop.margins()
        numbers = [number(x, 3) for x in (*margin_numbers(m), m.crossover_Hz, m.bandwidth_Hz)]
        table.add_row(loop.name, loop.phase, *numbers, "yes" if m.stable else "NO")
    return table


def margin_numbers(m: Margins) -> tuple[float, float, float, float]:
    return m.gain, m.phase_deg, 1e3 * m.delay_s, m.sensitivity_peak


def cycle_table(found: Study) -> Table:
    heads = ("", "run", "peak to peak in µm", "period in s", "rms in µm", "hunts")
    table = text_table(TEXT("title.cycles"), heads, ("", "run"))
    for name, parts in found.cycles().items():
        for part, c in parts.items():
            numbers = [number(x, 3) for x in (1e6 * c.peak_to_peak_m, c.period_s, 1e6 * c.rms_m)]
            table.add_row(name, part, *numbers, "yes" if c.hunts else "no")
    return table


def command_unit(model: ControlModel) -> str:
    """Unit of the command: m of a carriage, A or V of a coil."""
    return model.drive.commanded.rpartition("_")[2]


def gains_json(pid: Pid, lqr: Gains, unit: str) -> dict[str, Any]:
    """The designed gains; K_p in `command_unit` per m."""
    return {
        "command_unit": unit,
        "pid": {"K_p": pid.K_p, "K_i_per_s": pid.K_i, "K_d_s": pid.K_d, "filter_s": pid.filter_s},
        "lqr": {"K": dict(zip(map(spelled, lqr.states), lqr.K.tolist(), strict=True)), "K_i_per_s": lqr.K_i},
    }


def _feedback(gains: Gains, unit: str) -> str:
    own = zip(map(spelled, gains.states), gains.K, strict=True)
    terms = [TEXT("gain", state=name, gain=float(gain), unit=_per(unit, name)) for name, gain in own]
    return TEXT("feedback", terms=", ".join(terms), K_i=float(gains.K_i), unit=unit)


def _per(unit: str, state: str) -> str:
    if state == "v":
        return f"{unit} s/m"
    return f"{unit}/{'m' if state == 'x' else state.rpartition('_')[2]}"
