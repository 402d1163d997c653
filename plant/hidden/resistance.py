"""Hidden effects on resistance: a factor on the hoop stress, or a change of F_e or of the slip limit alone."""

import math

from plant.compiling import compiled
from plant.hidden.registry import ONSET, ROW
from plant.layout import S_ADHESION, S_SINCE_REST, S_TRAVEL, S_WOBBLE
from plant.tables import Floats


@compiled
def _along_lumen(x: float, h: Floats) -> float:
    level = 1.0
    if h[ROW.fold_periodic, 0] != 0.0:
        q = 2 * math.pi * x / h[ROW.fold_periodic, 1] + h[ROW.fold_periodic, 2]
        level += h[ROW.fold_periodic, 0] * (math.sin(q) + 0.35 * math.sin(2 * q + 0.8))
    if h[ROW.lumen_taper, 0] != 0.0:
        level += h[ROW.lumen_taper, 0] * math.tanh((x - h[ROW.lumen_taper, 1]) / h[ROW.lumen_taper, 2])
    if h[ROW.stenosis, 0] != 0.0:
        offset = x - h[ROW.stenosis, 1]
        width = h[ROW.stenosis, 2] * (1.5 if offset > 0 else 1.0)
        if abs(offset) < width:
            level += h[ROW.stenosis, 0] * math.cos(0.5 * math.pi * offset / width) ** 2
    return level


@compiled
def _with_history(t: float, s: Floats, h: Floats) -> float:
    level = 1.0
    if h[ROW.tissue_drying, 0] != 0.0:
        level += h[ROW.tissue_drying, 0] * (1 - math.exp((h[ROW.tissue_drying, ONSET] - t) / h[ROW.tissue_drying, 1]))
    if h[ROW.preconditioning, 0] != 0.0:
        level -= h[ROW.preconditioning, 0] * s[S_TRAVEL] / (s[S_TRAVEL] + h[ROW.preconditioning, 1])
    if h[ROW.dwell_adhesion, 0] != 0.0:
        left = 1 - s[S_SINCE_REST] / h[ROW.dwell_adhesion, 2]
        if left > 0:
            level += h[ROW.dwell_adhesion, 0] * s[S_ADHESION] * left * left
    if h[ROW.travel_step, 0] != 0.0:
        ramp = min(max((s[S_TRAVEL] - h[ROW.travel_step, 1]) * 1e3, 0.0), 1.0)
        level += h[ROW.travel_step, 0] * ramp * ramp * (3 - 2 * ramp)
    if h[ROW.rolling_wobble, 0] != 0.0:
        level += h[ROW.rolling_wobble, 0] * math.sin(s[S_WOBBLE])
    return level


@compiled
def resistance_level(x: float, v: float, t: float, s: Floats, h: Floats) -> float:
    """Factor on the hoop stress at place `x` in m, speed `v` in m/s, time `t` in s, memory `s`. Not negative."""
    level = _along_lumen(x, h) * _with_history(t, s, h)
    if h[ROW.stribeck, 0] != 0.0:
        level *= 1 + h[ROW.stribeck, 0] / (1 + (v / h[ROW.stribeck, 1]) ** 2)
    if h[ROW.directional_asymmetry, 0] != 0.0:
        level *= 1 + h[ROW.directional_asymmetry, 0] * v / math.sqrt(v * v + h[ROW.directional_asymmetry, 1] ** 2)
    return max(level, 0.0)


@compiled
def resistance_at_nose(resistance: float, v: float, h: Floats) -> float:
    """Resistance in N at speed `v` in m/s as effects leave it that the slip limit does not feel. Not negative."""
    if h[ROW.nose_asymmetry, 0] != 0.0:
        resistance *= 1 + h[ROW.nose_asymmetry, 0] * v / math.sqrt(v * v + h[ROW.nose_asymmetry, 1] ** 2)
    if h[ROW.film_weakening, 0] != 0.0:
        resistance += h[ROW.film_weakening, 0] / (1 + abs(v) / h[ROW.film_weakening, 1])
    return max(resistance, 0.0)


@compiled
def hoop_at_slip(hoop: float, x: float, h: Floats) -> float:
    """Factor on the hoop stress that the slip limit feels at place `x` in m, given the one at the nose."""
    if h[ROW.slip_folds, 0] != 0.0:
        q = 2 * math.pi * x / h[ROW.slip_folds, 1]
        hoop *= 1 + h[ROW.slip_folds, 0] * math.sin(q) * (1 + 0.5 * math.cos(q))
    return hoop


@compiled
def remember_motion(v: float, dt: float, s: Floats, h: Floats) -> None:
    """Advance what resistance remembers over one step at speed `v`: path, bond strength, wobble angle."""
    path = abs(v) * dt
    s[S_TRAVEL] += path
    if h[ROW.dwell_adhesion, 0] != 0.0:
        if v == 0.0:
            if s[S_SINCE_REST] > 0.0:
                s[S_ADHESION] *= max(1 - s[S_SINCE_REST] / h[ROW.dwell_adhesion, 2], 0.0) ** 2
                s[S_SINCE_REST] = 0.0
            s[S_ADHESION] += dt / h[ROW.dwell_adhesion, 1] * (1 - s[S_ADHESION]) ** 2
        else:
            s[S_SINCE_REST] += path
    if h[ROW.rolling_wobble, 0] != 0.0:
        rate = abs(v) / h[ROW.rolling_wobble, 1]
        s[S_WOBBLE] += 2 * math.pi * dt * (rate + math.sqrt(rate * h[ROW.rolling_wobble, 2]))
