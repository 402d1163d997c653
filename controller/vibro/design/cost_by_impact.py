"""What a mean speed costs with every kind of impact: without, at the front stop, at the rear one, at both; square and
least-energy cycles.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from controller.vibro.cycles import IMPACTS, Cycles, Gait, Impact, impact_of
from controller.vibro.design.optimal_cycle import optimal_cycle
from controller.vibro.design.speed_map import SpeedMap, best_square
from controller.vibro.gears import DriveMap
from controller.vibro.waveform import Waveform

Shape = Literal["square", "optimal", "map"]
_EXACT = 0.02  # share of the speed to which a cycle is brought
_ROUGHLY = 0.25


@dataclass(frozen=True)
class Alternative:
    """One way to go at a mean speed: the `waveform` with what it does, the stop that it strikes and where it comes
    from: a square wave, the optimiser, or the drive map that a controller runs on.
    """

    waveform: Waveform
    pace: Gait
    impact: Impact
    shape: Shape


def squares(cycles: Cycles, table: SpeedMap, speed_m_s: float) -> list[Alternative]:
    """The cheapest square wave at `speed_m_s` of every kind of impact that the map `table` has there."""
    found = ((impact, best_square(cycles, table, speed_m_s, impact=impact)) for impact in IMPACTS)
    return [Alternative(*best, impact, "square") for impact, best in found if best is not None]


def optima(cycles: Cycles, speed_m_s: float, guesses: list[Waveform]) -> list[Alternative]:
    """The cheapest least-energy cycle at `speed_m_s` of every kind of impact that comes of `guesses`; which stop one
    strikes is what the optimiser made of it, not what it began with.
    """
    best: dict[Impact, Alternative] = {}
    for guess in guesses:
        wave, pace = brought_to(cycles, optimal_cycle(cycles, speed_m_s, guess, close=_ROUGHLY).waveform, speed_m_s)
        impact = impact_of(cycles.model, pace)
        if abs(pace.speed_m_s / speed_m_s - 1) < _EXACT and (
            impact not in best or pace.energy_J_per_m < best[impact].pace.energy_J_per_m
        ):
            best[impact] = Alternative(wave, pace, impact, "optimal")
    return list(best.values())


def from_map(cycles: Cycles, drive: DriveMap, speed_m_s: float) -> Alternative:
    """What the `drive` map makes of the commanded `speed_m_s`."""
    wave = drive.choose(speed_m_s).waveform
    pace = cycles.pace(wave)
    return Alternative(wave, pace, impact_of(cycles.model, pace), "map")


def cheapest(found: list[Alternative]) -> Alternative | None:
    """The choice among `found`: least electrical energy for the way."""
    return min(found, key=lambda one: one.pace.energy_J_per_m, default=None)


def brought_to(cycles: Cycles, wave: Waveform, speed_m_s: float) -> tuple[Waveform, Gait]:
    """`wave` brought within 2 % of `speed_m_s` by its strength, as far as that goes."""
    pace = cycles.pace(wave)
    for _ in range(10):
        ratio = pace.speed_m_s / speed_m_s
        if not 0.2 < ratio < 5 or abs(ratio - 1) < _EXACT:
            break
        wave = wave.scaled(ratio**-0.4)
        pace = cycles.pace(wave)
    return wave, pace
