"""Hidden effects on the body: factors on the hoop stress, resistance, slip limit, and further forces along +x."""

import math

from plant.compiling import compiled
from plant.hidden.registry import ONSET, ROW
from plant.layout import P_MASS, P_WEIGHT, S_ADHESION, S_RELAX, S_SINCE_REST, S_SWEPT, S_TRAVEL, S_WOBBLE
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
    """Factor on the hoop stress at position `x` in m, speed `v` in m/s, time `t` in s, memory `s`; not negative."""
    level = _along_lumen(x, h) * _with_history(t, s, h)
    if h[ROW.stribeck, 0] != 0.0:
        level *= 1 + h[ROW.stribeck, 0] / (1 + (v / h[ROW.stribeck, 1]) ** 2)
    if h[ROW.directional_asymmetry, 0] != 0.0:
        level *= 1 + h[ROW.directional_asymmetry, 0] * v / math.sqrt(v * v + h[ROW.directional_asymmetry, 1] ** 2)
    return max(level, 0.0)


@compiled
def resistance_at_nose(resistance: float, v: float, h: Floats) -> float:
    """Resistance in N at speed `v` in m/s with the effects that leave the slip limit unchanged; not negative."""
    if h[ROW.nose_asymmetry, 0] != 0.0:
        resistance *= 1 + h[ROW.nose_asymmetry, 0] * v / math.sqrt(v * v + h[ROW.nose_asymmetry, 1] ** 2)
    if h[ROW.film_weakening, 0] != 0.0:
        resistance += h[ROW.film_weakening, 0] / (1 + abs(v) / h[ROW.film_weakening, 1])
    return max(resistance, 0.0)


@compiled
def hoop_at_slip(hoop: float, x: float, h: Floats) -> float:
    """Factor on the hoop stress in the slip limit at position `x` in m, given the factor at the nose."""
    if h[ROW.slip_folds, 0] != 0.0:
        q = 2 * math.pi * x / h[ROW.slip_folds, 1]
        hoop *= 1 + h[ROW.slip_folds, 0] * math.sin(q) * (1 + 0.5 * math.cos(q))
    return hoop


@compiled
def remember_motion(v: float, dt: float, s: Floats, h: Floats) -> None:
    """Advance the memories of resistance by one step at speed `v`: path, bond strength, wobble angle."""
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


_LOSS = 1.5  # s/m, Hunt-Crossley damping of the hidden stops


@compiled
def suspension_force(r: float, rate: float, h: Floats) -> float:
    """Force in N of the hidden suspension on the inner mass at `r` in m and `r'` in m/s, positive inwards."""
    force = 0.0
    if h[ROW.spring_damping, 0] != 0.0:
        force += h[ROW.spring_damping, 0] * rate * (1 + 2.0 * abs(rate))
    if h[ROW.end_stop_impact, 0] != 0.0:
        if r > h[ROW.end_stop_impact, 0]:
            force += max(h[ROW.end_stop_impact, 1] * (r - h[ROW.end_stop_impact, 0]) * (1 + _LOSS * rate), 0.0)
        elif r < -h[ROW.end_stop_impact, 0]:
            force += min(h[ROW.end_stop_impact, 1] * (r + h[ROW.end_stop_impact, 0]) * (1 - _LOSS * rate), 0.0)
    if h[ROW.spring_stiffening, 0] != 0.0:
        force += h[ROW.spring_stiffening, 0] * r * (math.sqrt(1 + (r / h[ROW.spring_stiffening, 1]) ** 2) - 1)
    if h[ROW.guide_rubbing, 0] != 0.0:
        force += h[ROW.guide_rubbing, 0] * rate / (abs(rate) + 3e-3) * (1 + 0.5 * math.exp(-abs(rate) / 0.15))
    return force


@compiled
def field_reach(r: float, h: Floats) -> float:
    """Factor on the coil's force on an inner mass at the offset `r` in m."""
    return float(1 - h[ROW.coil_field, 0] * math.tanh(r / h[ROW.coil_field, 1])) if h[ROW.coil_field, 0] != 0.0 else 1.0


@compiled
def hidden_force(x: float, v: float, t: float, s: Floats, p: Floats, h: Floats) -> float:
    """Sum of the hidden forces in N at `x` in m, `v` in m/s, `t` in s; the forms are in the registry."""
    force = 0.0
    if h[ROW.viscous_drag, 0] != 0.0 and v != 0.0:
        force -= math.copysign(h[ROW.viscous_drag, 0] * (abs(v) * 100.0) ** 0.85, v)
    if h[ROW.peristaltic_wave, 0] != 0.0:
        force += h[ROW.peristaltic_wave, 0] * max(
            0.0, math.sin(2 * math.pi * (t / h[ROW.peristaltic_wave, 1] - x / h[ROW.peristaltic_wave, 2]))
        )
    if h[ROW.respiration, 0] != 0.0:
        force += h[ROW.respiration, 0] * (2 * abs(math.cos(math.pi * t / h[ROW.respiration, 1])) ** 3 - 0.85)
    if h[ROW.incline_gravity, 0] != 0.0:
        force -= p[P_WEIGHT] * math.sin(h[ROW.incline_gravity, 0])
    if h[ROW.fluid_plug, 0] != 0.0 and v != 0.0:
        ahead = abs(s[S_SWEPT]) / (abs(s[S_SWEPT]) + h[ROW.fluid_plug, 1])
        force -= math.copysign(h[ROW.fluid_plug, 0] * ahead * (abs(v) * 100.0) ** 0.8, v)
    if h[ROW.stress_relaxation, 0] != 0.0:
        force -= h[ROW.stress_relaxation, 0] * s[S_RELAX]
    return force


@compiled
def remember_stress(v: float, dt: float, s: Floats, h: Floats) -> None:
    """Advance the path since the last reversal, and the stress, which relaxes with a power of itself."""
    if h[ROW.fluid_plug, 0] != 0.0 and v != 0.0:
        s[S_SWEPT] = math.copysign((abs(s[S_SWEPT]) if v * s[S_SWEPT] > 0 else 0.0) + abs(v) * dt, v)
    if h[ROW.stress_relaxation, 0] != 0.0:
        q = s[S_RELAX]
        growth = (v - q * abs(v)) / h[ROW.stress_relaxation, 1]
        s[S_RELAX] = q + dt * (growth - q * math.sqrt(abs(q)) / h[ROW.stress_relaxation, 2])


@compiled
def inertia(p: Floats, h: Floats) -> float:
    """Mass of the body in kg, with the hidden added mass."""
    return float(p[P_MASS] + h[ROW.added_mass, 0])
