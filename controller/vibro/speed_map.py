"""Mean speed and energy of square waves over period, duty and amplitude, and the cheapest one for a speed."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from controller.signals import Array
from controller.vibro.cycles import IMPACTS, Cycles, Gait, Impact, VibroModel, impact_of
from controller.vibro.waveform import Waveform

# of the square waves: periods over the inner mass's own, dense about the resonance; a duty of a half moves nothing
PERIOD_RATIOS = (0.6, 0.7, 0.8, 0.9, 1.0, 1.05, 1.1, 1.3, 1.5, 1.7, 1.9, 2.1)
DUTIES = (0.15, 0.2, 0.25, 0.3, 0.4, 0.6, 0.7, 0.75, 0.8, 0.85)
AMPLITUDES = (0.15, 0.2, 0.25, 0.35, 0.5, 0.7, 1.0)  # of the full force
_TRIED = 8  # cheapest squares of the map that are corrected
_EXACT = 0.02  # greatest error of the speed, as a share


def free_period(model: VibroModel) -> float:
    """Period in s of the inner mass on its spring with the body fixed."""
    stiffness = float(model.values.get("spring_stiffness_N_per_m", model.drive.spring_stiffness_N_per_m))
    if not stiffness > 0:
        raise ValueError(f"spring_stiffness_N_per_m must be above 0 for a resonant drive; got {stiffness:g}")
    return 2 * math.pi * math.sqrt(model.drive.inner_mass_kg / stiffness)


@dataclass(frozen=True)
class SpeedMap:
    """`speed` in m/s and `energy` in J/m (= mJ/mm), each (P, D, A), over `period_s` (P,), `duty` (D,), `amplitude`
    (A,); `impact` (P, D, A): index in `IMPACTS` of the stop that is hit.
    """

    period_s: Array
    duty: Array
    amplitude: Array
    speed: Array
    energy: Array
    impact: NDArray[np.int8]

    def squares(self, low_m_s: float, high_m_s: float, impact: Impact | None = None) -> list[Waveform]:
        """The square waves with speeds between the two, the cheapest first, of those with `impact`."""
        fits = (self.speed >= low_m_s) & (self.speed <= high_m_s)
        inside = np.argwhere(fits if impact is None else fits & (self.impact == IMPACTS.index(impact)))
        inside = inside[np.argsort(self.energy[tuple(inside.T)], kind="stable")] if len(inside) else inside
        return [
            Waveform.square(float(self.period_s[i]), float(self.duty[j]), float(self.amplitude[k]))
            for i, j, k in inside
        ]


def speed_map(
    cycles: Cycles,
    ratios: tuple[float, ...] = PERIOD_RATIOS,
    duties: tuple[float, ...] = DUTIES,
    amplitudes: tuple[float, ...] = AMPLITUDES,
) -> SpeedMap:
    """The map of a model, periods as multiples of the inner mass's free period."""
    periods = np.asarray(ratios) * free_period(cycles.model)
    shape = (len(ratios), len(duties), len(amplitudes))
    speed, energy, impact = np.zeros(shape), np.zeros(shape), np.zeros(shape, dtype=np.int8)
    for i, j, k in np.ndindex(*shape):
        gait = cycles.gait(Waveform.square(float(periods[i]), duties[j], amplitudes[k]))
        speed[i, j, k], energy[i, j, k] = gait.speed_m_s, gait.energy_J_per_m
        impact[i, j, k] = IMPACTS.index(impact_of(cycles.model, gait))
    return SpeedMap(periods, np.asarray(duties), np.asarray(amplitudes), speed, energy, impact)


def best_square(
    cycles: Cycles, table: SpeedMap, speed_m_s: float, impact: Impact | None = None
) -> tuple[Waveform, Gait] | None:
    """The cheapest square wave at `speed_m_s`, of those with `impact` if given: those of the map within a quarter of
    it, corrected by their amplitude. None if the map has nothing within 2 %.
    """
    ends = sorted((0.75 * speed_m_s, 1.25 * speed_m_s))
    best: tuple[Waveform, Gait] | None = None
    for candidate in table.squares(ends[0], ends[1], impact)[:_TRIED]:
        wave, gait = _brought_to(cycles, candidate, speed_m_s)
        fits = abs(gait.speed_m_s / speed_m_s - 1) < _EXACT and impact in (None, impact_of(cycles.model, gait))
        if fits and (best is None or gait.energy_J_per_m < best[1].energy_J_per_m):
            best = (wave, gait)
    return best


def _brought_to(cycles: Cycles, wave: Waveform, speed: float) -> tuple[Waveform, Gait]:
    """The square wave near `wave` at `speed`, by a few steps of its amplitude."""
    gait = cycles.gait(wave)
    for _ in range(6):
        ratio = gait.speed_m_s / speed
        if not ratio > 0 or abs(ratio - 1) < 0.5 * _EXACT:
            break
        wave = wave.scaled(min(max(ratio**-0.6, 0.8), 1.25))
        gait = cycles.gait(wave)
    return wave, gait


Shape = Literal["square", "optimal", "map"]


@dataclass(frozen=True)
class Alternative:
    """One waveform for a mean speed, its gait, the stop that it strikes and its origin."""

    waveform: Waveform
    gait: Gait
    impact: Impact
    shape: Shape


def squares(cycles: Cycles, table: SpeedMap, speed_m_s: float) -> list[Alternative]:
    """The cheapest square wave at `speed_m_s` of every kind of impact in the map `table`."""
    found = ((impact, best_square(cycles, table, speed_m_s, impact=impact)) for impact in IMPACTS)
    return [Alternative(*best, impact, "square") for impact, best in found if best is not None]
