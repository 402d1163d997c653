"""Hidden effects on resistance: a factor on the hoop stress, so on F_e and on what presses on the wall, or a change of
F_e or of the slip limit alone.
"""

import math
from typing import Final

from plant.compiling import compiled
from plant.hidden.registry import ONSET, ROWS
from plant.layout import S_ADHESION, S_SINCE_REST, S_TRAVEL, S_WOBBLE
from plant.tables import Floats

STRIBECK: Final = ROWS["stribeck"]
ASYMMETRY: Final = ROWS["directional_asymmetry"]
FOLDS: Final = ROWS["fold_periodic"]
TAPER: Final = ROWS["lumen_taper"]
STENOSIS: Final = ROWS["stenosis"]
DRYING: Final = ROWS["tissue_drying"]
PRECONDITIONING: Final = ROWS["preconditioning"]
ADHESION: Final = ROWS["dwell_adhesion"]
NOSE: Final = ROWS["nose_asymmetry"]
FILM: Final = ROWS["film_weakening"]
SLIP: Final = ROWS["slip_folds"]
STEP: Final = ROWS["travel_step"]
WOBBLE: Final = ROWS["rolling_wobble"]


@compiled
def _along_lumen(x: float, h: Floats) -> float:
    level = 1.0
    if h[FOLDS, 0] != 0.0:
        q = 2 * math.pi * x / h[FOLDS, 1] + h[FOLDS, 2]
        level += h[FOLDS, 0] * (math.sin(q) + 0.35 * math.sin(2 * q + 0.8))
    if h[TAPER, 0] != 0.0:
        level += h[TAPER, 0] * math.tanh((x - h[TAPER, 1]) / h[TAPER, 2])
    if h[STENOSIS, 0] != 0.0:
        offset = x - h[STENOSIS, 1]
        width = h[STENOSIS, 2] * (1.5 if offset > 0 else 1.0)
        if abs(offset) < width:
            level += h[STENOSIS, 0] * math.cos(0.5 * math.pi * offset / width) ** 2
    return level


@compiled
def _with_history(t: float, s: Floats, h: Floats) -> float:
    level = 1.0
    if h[DRYING, 0] != 0.0:
        level += h[DRYING, 0] * (1 - math.exp((h[DRYING, ONSET] - t) / h[DRYING, 1]))
    if h[PRECONDITIONING, 0] != 0.0:
        level -= h[PRECONDITIONING, 0] * s[S_TRAVEL] / (s[S_TRAVEL] + h[PRECONDITIONING, 1])
    if h[ADHESION, 0] != 0.0:
        left = 1 - s[S_SINCE_REST] / h[ADHESION, 2]
        if left > 0:
            level += h[ADHESION, 0] * s[S_ADHESION] * left * left
    if h[STEP, 0] != 0.0:
        ramp = min(max((s[S_TRAVEL] - h[STEP, 1]) * 1e3, 0.0), 1.0)
        level += h[STEP, 0] * ramp * ramp * (3 - 2 * ramp)
    if h[WOBBLE, 0] != 0.0:
        level += h[WOBBLE, 0] * math.sin(s[S_WOBBLE])
    return level


@compiled
def resistance_level(x: float, v: float, t: float, s: Floats, h: Floats) -> float:
    """Factor on the hoop stress at place `x` in m, speed `v` in m/s, time `t` in s, memory `s`. Not negative."""
    level = _along_lumen(x, h) * _with_history(t, s, h)
    if h[STRIBECK, 0] != 0.0:
        level *= 1 + h[STRIBECK, 0] / (1 + (v / h[STRIBECK, 1]) ** 2)
    if h[ASYMMETRY, 0] != 0.0:
        level *= 1 + h[ASYMMETRY, 0] * v / math.sqrt(v * v + h[ASYMMETRY, 1] ** 2)
    return max(level, 0.0)


@compiled
def resistance_at_nose(resistance: float, v: float, h: Floats) -> float:
    """Resistance in N at speed `v` in m/s as effects leave it that the slip limit does not feel. Not negative."""
    if h[NOSE, 0] != 0.0:
        resistance *= 1 + h[NOSE, 0] * v / math.sqrt(v * v + h[NOSE, 1] ** 2)
    if h[FILM, 0] != 0.0:
        resistance += h[FILM, 0] / (1 + abs(v) / h[FILM, 1])
    return max(resistance, 0.0)


@compiled
def hoop_at_slip(hoop: float, x: float, h: Floats) -> float:
    """Factor on the hoop stress that the slip limit feels at place `x` in m, given the one at the nose."""
    if h[SLIP, 0] != 0.0:
        q = 2 * math.pi * x / h[SLIP, 1]
        hoop *= 1 + h[SLIP, 0] * math.sin(q) * (1 + 0.5 * math.cos(q))
    return hoop


@compiled
def remember_motion(v: float, dt: float, s: Floats, h: Floats) -> None:
    """Advance what resistance remembers over one step at speed `v`: path, bond strength, wobble angle."""
    path = abs(v) * dt
    s[S_TRAVEL] += path
    if h[ADHESION, 0] != 0.0:
        if v == 0.0:
            if s[S_SINCE_REST] > 0.0:
                s[S_ADHESION] *= max(1 - s[S_SINCE_REST] / h[ADHESION, 2], 0.0) ** 2
                s[S_SINCE_REST] = 0.0
            s[S_ADHESION] += dt / h[ADHESION, 1] * (1 - s[S_ADHESION]) ** 2
        else:
            s[S_SINCE_REST] += path
    if h[WOBBLE, 0] != 0.0:
        rate = abs(v) / h[WOBBLE, 1]
        s[S_WOBBLE] += 2 * math.pi * dt * (rate + math.sqrt(rate * h[WOBBLE, 2]))
