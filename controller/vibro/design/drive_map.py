"""The drive map of a model: seeds from its speed map, checked against wrong parameters, optimised, in gears."""

import hashlib
import math
import os
from dataclasses import replace
from typing import Final

import numpy as np
from pydantic import TypeAdapter

from controller.vibro.cycles import Cycles, VibroModel
from controller.vibro.design.optimal_cycle import optimal_cycle
from controller.vibro.design.speed_map import SpeedMap, speed_map, squares
from controller.vibro.gears import DriveMap, Gear, gear_of
from controller.vibro.waveform import Waveform
from models.files.access import cache_folder, read_text

SEEDS_M_S = (14e-3, 4e-3)
"""Mean speeds for which a direction's shapes are found, one gear each; a gear's other speeds come from its strength."""
_ROUNDS, _CLOSE = 5, 0.15  # of the optimal cycle's solver, and how close to the wanted speed it must end
_WRONG = 0.15  # by which the parameters are off that a wave must bear
_LEAST = 0.2  # of the seed's speed that a seed must keep with wrong parameters
# period over the inner mass's own, from which the map's square waves are made
_RATIOS = (0.6, 0.7, 0.8, 0.9, 1.0, 1.05, 1.1, 1.3, 1.5, 1.7, 1.9, 2.1)
_DUTIES = (0.15, 0.2, 0.25, 0.3, 0.4, 0.6, 0.7, 0.75, 0.8, 0.85)  # of them
_AMPLITUDES = (0.15, 0.2, 0.25, 0.35, 0.5, 0.7, 1.0)  # of them, of the full force
_TRIED = 12  # square waves of a speed that are checked
_SAVES, _IN_VAIN = 0.02, 2  # of the energy, what a guess is worth; guesses in a row that are not
_FURTHER = 1.2  # how much further the plain square must reach for a gear of its own
_LAG_S = (0.03, 0.5)  # shortest and longest lag of the mean speed
_MAPS: Final = TypeAdapter(DriveMap)
_FORMAT = 12  # of the kept map: another one is made anew


def rough_map(cycles: Cycles) -> SpeedMap:
    """The speed map on the grid that seeds are looked for on."""
    return speed_map(cycles, _RATIOS, _DUTIES, _AMPLITUDES)


def wrong_models(model: VibroModel) -> list[VibroModel]:
    """The model with its parameters off by `_WRONG`: spring either way, then drive against friction either way."""
    known = {p.key for p in model.assembly().parameters}
    more, less = 1 + _WRONG, 1 - _WRONG
    corners = [{"spring_stiffness_N_per_m": less}, {"spring_stiffness_N_per_m": more}]
    for drive, friction in ((less, more), (more, less)):
        corners.append({"force_N": drive, "hoop_stress_factor": friction, "friction_coefficient": friction})
    return [model.at(**{name: factor for name, factor in corner.items() if name in known}) for corner in corners]


def seed_square(wrong: list[Cycles], table: SpeedMap, speed_m_s: float) -> Waveform | None:
    """The cheapest square wave within 0.6 to 1.5 of `speed_m_s` that keeps its direction with wrong parameters, else
    the one of the cheapest that keeps most of its speed; None where the map has no such speed.
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
    """The cheapest least-energy cycle at `speed_m_s` found from `guesses` that keeps its direction with wrong
    parameters; the square `seed` where there is none. Two guesses in a row that save little are the last.
    """
    best, least, in_vain = seed, math.inf, 0
    for guess in guesses:
        optimum = optimal_cycle(nominal, speed_m_s, guess, _ROUNDS, _CLOSE)
        energy = optimum.pace.energy_J_per_m if optimum.found else math.inf
        in_vain += 1
        if energy < least and _kept(wrong, optimum.waveform, speed_m_s) >= _LEAST:
            in_vain = 0 if energy < (1 - _SAVES) * least else in_vain
            best, least = optimum.waveform, energy
        if least < math.inf and in_vain == _IN_VAIN:
            break
    return best


def _kept(wrong: list[Cycles], wave: Waveform, speed: float) -> float:
    """The least share of `speed` that `wave` keeps with wrong parameters."""
    return min(c.pace(wave).speed_m_s / speed for c in wrong)


def lag(cycles: Cycles, waveform: Waveform) -> float:
    """How long in s the mean speed takes to come up from rest: `t - x(t)/v` once it is steady (area method)."""
    pace = cycles.pace(waveform)
    n = max(math.ceil(1.0 / waveform.period_s), 4)
    path = cycles.path(waveform, n)
    if pace.speed_m_s == 0:
        return _LAG_S[1]
    return float(np.clip(n * waveform.period_s - path[-1] / pace.speed_m_s, *_LAG_S))


def design(model: VibroModel, optimise: bool = True, table: SpeedMap | None = None) -> DriveMap:
    """The drive map of `model`; `optimise` False keeps to scaled square waves (seconds instead of a minute). `table` is
    its speed map where there is one already. A direction that the model does not reach has no gear. Every kind of
    impact that a square wave has at a gear's speed is among the guesses from which its cycle is optimised, so which
    stop it strikes, if any, is a matter of energy.
    """
    cycles = Cycles(model)
    wrong = [Cycles(m) for m in wrong_models(model)]
    table = table or rough_map(cycles)
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
    """The same as `design`, kept on disk for the next time under what it was made from."""
    made_from = repr((_FORMAT, model, [(p.key, p.value) for p in model.assembly().parameters], optimise))
    file = cache_folder() / f"vibro_{hashlib.sha256(made_from.encode()).hexdigest()[:20]}.json"
    try:
        return from_json(read_text(file, "drive map"))
    except (OSError, ValueError):
        found = design(model, optimise)
    draft = file.with_suffix(f".{os.getpid()}")
    draft.write_text(to_json(found), encoding="utf-8")
    os.replace(draft, file)
    return found


def to_json(drive: DriveMap) -> str:
    """The map as text; `from_json` reads it back exactly."""
    return _MAPS.dump_json(drive, indent=1).decode()


def from_json(text: str) -> DriveMap:
    """A map from text. Raises ValueError where it is none."""
    return _MAPS.validate_json(text)
