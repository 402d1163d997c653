"""What a design found in words and tables, for terminal and page alike."""

from __future__ import annotations

from rich.table import Table

from controller.design.describing_function import AMPLITUDES_M, Balance
from controller.design.study import Study
from controller.model.control_model import ControlModel
from hil.app.design.gains import gains_words
from hil.app.quantities import number


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


def margin_table(found: Study) -> Table:
    """Gain, phase and delay margins of each loop, a row for a loop and state of the wall."""
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
            *(number(x, 3) for x in numbers),
            "yes" if m.stable else "NO",
        )
    return table


def cycle_table(found: Study) -> Table:
    """Limit cycles of each controller under set-valued friction, a row for a run."""
    table = Table(title="set-valued friction, no noise: error in the last half", title_justify="left")
    for column in ("", "run", "peak to peak in µm", "period in s", "rms in µm", "hunts"):
        table.add_column(column, justify="left" if column in ("", "run") else "right")
    for name, parts in found.cycles().items():
        for part, c in parts.items():
            table.add_row(
                name,
                part,
                *(number(x, 3) for x in (1e6 * c.peak_to_peak_m, c.period_s, 1e6 * c.rms_m)),
                "yes" if c.hunts else "no",
            )
    return table
