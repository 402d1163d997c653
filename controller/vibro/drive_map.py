"""The drive map of a model: the speeds of square waves, seeds checked with wrong parameters, optimised, in gears."""

import hashlib
import math
import os
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from controller.signals import Array
from controller.vibro.cycles import IMPACTS, Cycles, Gait, Impact, VibroModel, impact_of
from controller.vibro.gears import DriveMap, Gear, gear_of
from controller.vibro.optimal_cycle import optimal_cycle
from controller.vibro.waveform import Waveform
from models.files.access import cache_folder, read_text

# of the square waves: periods over the inner mass's own, dense about the resonance; a duty of a half moves nothing
PERIOD_RATIOS = (0.6, 0.7, 0.8, 0.9, 1.0, 1.05, 1.1, 1.3, 1.5, 1.7, 1.9, 2.1)
DUTIES = (0.15, 0.2, 0.25, 0.3, 0.4, 0.6, 0.7, 0.75, 0.8, 0.85)
AMPLITUDES = (0.15, 0.2, 0.25, 0.35, 0.5, 0.7, 1.0)  # of the full force
_CORRECTED = 8  # cheapest squares of the map that are corrected
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
    for candidate in table.squares(ends[0], ends[1], impact)[:_CORRECTED]:
        wave, gait = _brought_to(cycles, candidate, speed_m_s)
        fits = abs(gait.speed_m_s / speed_m_s - 1) < _EXACT and impact in (None, impact_of(cycles.model, gait))
        if fits and (best is None or gait.energy_J_per_m < best[1].energy_J_per_m):
            best = (wave, gait)
    return best


def _brought_to(cycles: Cycles, wave: Waveform, speed: float) -> tuple[Waveform, Gait]:
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


SEEDS_M_S = (14e-3, 4e-3)
"""Mean speeds for which the shapes of a direction are designed, one gear each; strength gives a gear's other speeds."""
_WRONG = 0.15  # error of the parameters that a wave must bear
_LEAST = 0.2  # least share of its speed that a wave keeps with wrong parameters
_TRIED = 12  # square waves checked per speed
_SAVES, _IN_VAIN = 0.02, 2  # least saving of a guess; guesses in a row below it
_FURTHER = 1.1  # ratio of reach from which the plain square gets its own gear
_LAG_S = (0.03, 0.5)  # shortest and longest lag of the mean speed
MAPS: Final = TypeAdapter(DriveMap)
_FORMAT = 13  # of the cached map


def wrong_models(model: VibroModel) -> list[VibroModel]:
    """The model with parameters off by `_WRONG`: the spring up and down, then drive against friction up and down."""
    known = {p.key for p in model.assembly().parameters}
    more, less = 1 + _WRONG, 1 - _WRONG
    corners = [{"spring_stiffness_N_per_m": less}, {"spring_stiffness_N_per_m": more}]
    for drive, friction in ((less, more), (more, less)):
        corners.append({"force_N": drive, "hoop_stress_factor": friction, "friction_coefficient": friction})
    return [model.at(**{name: factor for name, factor in corner.items() if name in known}) for corner in corners]


def seed_square(wrong: list[Cycles], table: SpeedMap, speed_m_s: float) -> Waveform | None:
    """The cheapest square wave within 0.6 to 1.5 of `speed_m_s` that keeps its direction with wrong parameters, else
    the one of the cheapest that keeps most of its speed; None if the map has no such speed.
    """
    low, high = sorted((0.6 * speed_m_s, 1.5 * speed_m_s))
    best, most = None, -math.inf
    for wave in table.squares(low, high)[:_TRIED]:
        kept = _kept(wrong, wave, speed_m_s)
        if kept >= _LEAST:
            return wave
        if best is None or kept > most:
            best, most = wave, kept
    return best


def shape_at(
    nominal: Cycles, wrong: list[Cycles], speed_m_s: float, seed: Waveform, guesses: list[Waveform]
) -> Waveform:
    """The cheapest least-energy cycle at `speed_m_s` from `guesses` that keeps its direction with wrong parameters; the
    square `seed` without any. Two guesses in a row that save little are the last.
    """
    best, least, in_vain = seed, math.inf, 0
    for guess in guesses:
        found = optimal_cycle(nominal, speed_m_s, guess)
        in_vain += 1
        if found and found[1].energy_J_per_m < least and _kept(wrong, found[0], speed_m_s) >= _LEAST:
            in_vain = 0 if found[1].energy_J_per_m < (1 - _SAVES) * least else in_vain
            best, least = found[0], found[1].energy_J_per_m
        if least < math.inf and in_vain == _IN_VAIN:
            break
    return best


def _kept(wrong: list[Cycles], wave: Waveform, speed: float) -> float:
    """The least share of `speed` that `wave` keeps with wrong parameters."""
    return min(c.gait(wave).speed_m_s / speed for c in wrong)


def lag(cycles: Cycles, waveform: Waveform) -> float:
    """Rise time in s of the mean speed from rest: `t - x(t)/v` once it is steady (area method)."""
    gait = cycles.gait(waveform)
    n = max(math.ceil(1.0 / waveform.period_s), 4)
    path = cycles.path(waveform, n)
    if gait.speed_m_s == 0:
        return _LAG_S[1]
    return float(np.clip(n * waveform.period_s - path[-1] / gait.speed_m_s, *_LAG_S))


def design(model: VibroModel, optimise: bool = True, table: SpeedMap | None = None) -> DriveMap:
    """The drive map of `model`; `optimise` False keeps scaled square waves (seconds instead of a minute). `table` is
    its speed map if known. A direction that the model does not reach has no gear. Every kind of impact of a square wave
    at a gear's speed is among the guesses of its cycle, so energy decides which stop it strikes, if any.
    """
    cycles = Cycles(model)
    wrong = [Cycles(m) for m in wrong_models(model)]
    table = table or speed_map(cycles)
    gears: list[Gear] = []
    found: list[Waveform] = []
    for speed in (sign * size for sign in (1, -1) for size in SEEDS_M_S):
        seed = seed_square(wrong, table, speed)
        if seed is None:
            continue
        other = squares(cycles, table, speed) if optimise else []
        guesses = [seed, *(one.waveform for one in other), seed.flipped(), *(w.flipped() for w in found)]
        shape = shape_at(cycles, wrong, speed, seed, guesses) if optimise else seed
        found.append(shape)
        own = gear_of(cycles, shape, speed)
        plain = gear_of(cycles, seed, speed) if optimise else None
        gears += [] if own is None else [own]
        if plain is not None and (own is None or abs(plain.fastest_m_s) > _FURTHER * abs(own.fastest_m_s)):
            gears.append(replace(plain, home_m_s=plain.fastest_m_s))
    lags = [lag(cycles, g.waveforms[len(g.waveforms) // 2]) for g in gears]
    return DriveMap(tuple(gears), float(np.median(lags)) if lags else _LAG_S[1])


def designed(model: VibroModel, optimise: bool = True) -> DriveMap:
    """The same as `design`, cached on disk under a hash of its inputs."""
    made_from = repr((_FORMAT, model, [(p.key, p.value) for p in model.assembly().parameters], optimise))
    file = cache_folder() / f"vibro_{hashlib.sha256(made_from.encode()).hexdigest()[:20]}.json"
    try:
        return MAPS.validate_json(read_text(file, "drive map"))
    except (OSError, ValueError):
        found = design(model, optimise)
    draft = file.with_suffix(f".{os.getpid()}")
    draft.write_bytes(MAPS.dump_json(found, indent=1))
    os.replace(draft, file)
    return found
