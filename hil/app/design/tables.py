"""What a design found in words and tables, for terminal and page alike: poles, gains, margins, cycles."""

from typing import Any

from rich.table import Table

from controller.baselines import Gains, lqr_gains
from controller.design.describing_function import AMPLITUDES_M, Balance
from controller.design.study import Study
from controller.design.tuning import Margins, Pid
from controller.drives import driven_of
from controller.model.control_model import ControlModel
from controller.model.linear import linearise
from hil.app.console import text_table
from models.theta import spelled
from models.words.quantities import number

MARGINS = ("gain", "phase in deg", "more delay in ms", "sensitivity")


def words_of(found: Study, plant: ControlModel) -> list[str]:
    """Poles and gains, a line each."""
    poles = [
        f"sliding at {1e3 * found.speed_m_s:g} mm/s, wall in {linear.phase}: poles"
        f" {', '.join(_complex(rate) for rate in linear.rates())} 1/s"
        for linear in found.plants
    ]
    return [*poles, *gains_words(found.pid, found.lqr, plant)]


def balance_lines(found: Study) -> list[str]:
    """What the harmonic balance says, a line a controller."""
    return [f"harmonic balance, {name} at rest: {balance_words(balance)}" for name, balance in found.balances().items()]


def balance_words(found: list[Balance]) -> str:
    """What the harmonic balance of one loop says."""
    if not found:
        return f"no cycle from {1e3 * AMPLITUDES_M[0]:g} to {1e3 * AMPLITUDES_M[-1]:g} mm: stiction brings it to rest"
    hunts = "hunts at {0:.3g} mm, {1:.3g} Hz"
    rests = "comes to rest from a swing below {0:.3g} mm ({1:.3g} Hz), goes off from more"
    return "; ".join((hunts if one.stable else rests).format(1e3 * one.amplitude_m, one.frequency_Hz) for one in found)


def _complex(rate: complex) -> str:
    return f"{rate.real:.4g}" if rate.imag == 0 else f"{rate.real:.4g}{rate.imag:+.4g}j"


def margin_table(found: Study) -> Table:
    """Gain, phase and delay margins of each loop, a row for a loop and state of the wall."""
    heads = ("", "wall", *MARGINS, "crossover in Hz", "bandwidth in Hz", "stable")
    table = text_table(f"margins with {1e3 * found.delay_s:g} ms of delay", heads, ("", "wall"))
    for loop in found.loops:
        m = loop.margins()
        numbers = [number(x, 3) for x in (*margin_numbers(m), m.crossover_Hz, m.bandwidth_Hz)]
        table.add_row(loop.name, loop.phase, *numbers, "yes" if m.stable else "NO")
    return table


def margin_numbers(m: Margins) -> tuple[float, float, float, float]:
    """What stands under `MARGINS`."""
    return m.gain, m.phase_deg, 1e3 * m.delay_s, m.sensitivity_peak


def cycle_table(found: Study) -> Table:
    """Limit cycles of each controller under set-valued friction, a row for a run."""
    heads = ("", "run", "peak to peak in µm", "period in s", "rms in µm", "hunts")
    table = text_table("set-valued friction, no noise: error in the last half", heads, ("", "run"))
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


def gains_words(pid: Pid, lqr: Gains, model: ControlModel) -> list[str]:
    """Lines for the designed gains, and for those of the controllers that run."""
    unit = command_unit(model)
    own = f"K_p {pid.K_p:.4g} {unit}/m, K_i {pid.K_i:.4g} {unit}/(m s), K_d {pid.K_d:.4g} {unit} s/m"
    return [
        f"PID, from position error to {model.drive.commanded}: {own} (filter {1e3 * pid.filter_s:g} ms)",
        f"LQR: {_feedback(lqr, unit)}",
        "not used by track, sil and run, whose controllers have these gains, whatever the delay:",
        *_running(model),
    ]


def _running(model: ControlModel) -> list[str]:
    drive = driven_of(model.drive)
    pids = {"pid": drive.pid, "pid_friction": drive.pid_friction}
    pids["pid_estimated and the PID below the others"] = drive.pid_estimated
    lines = [
        f"  {name}, from position error to force: k_p {g.k_p:g} N/m, k_i {g.k_i:g} N/(m s), k_d {g.k_d:g} N s/m"
        for name, g in pids.items()
    ]
    return [
        *lines,
        (
            f"  lqr: {_feedback(lqr_gains(linearise(model, 'slip')), command_unit(model))} at this tick of"
            f" {1e3 * model.tick_s:g} ms"
        ),
    ]


def _feedback(gains: Gains, unit: str) -> str:
    own = zip(map(spelled, gains.states), gains.K, strict=True)
    terms = [f"{name} {gain:.4g} {_per(unit, name)}" for name, gain in own]
    return f"{', '.join(terms)}, K_i {gains.K_i:.4g} {unit}/(m s)"


def _per(unit: str, state: str) -> str:
    """Unit of a gain on `state`."""
    if state == "v":
        return f"{unit} s/m"
    return f"{unit}/{'m' if state == 'x' else state.rpartition('_')[2]}"
