"""Hidden forces that act on the capsule beside resistance, film and wall; positive along +x."""

import math

from plant.compiling import compiled
from plant.hidden.registry import ROW
from plant.layout import P_MASS, P_WEIGHT, S_RELAX
from plant.tables import Floats

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
    """Sum of the hidden forces in N at `x` in m, `v` in m/s, `t` in s; the forms stand in the registry."""
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
    if h[ROW.stress_relaxation, 0] != 0.0:
        force -= h[ROW.stress_relaxation, 0] * s[S_RELAX]
    return force


@compiled
def remember_stress(v: float, dt: float, s: Floats, h: Floats) -> None:
    """Advance the stress that builds up on the way and relaxes with a power of itself."""
    if h[ROW.stress_relaxation, 0] != 0.0:
        q = s[S_RELAX]
        growth = (v - q * abs(v)) / h[ROW.stress_relaxation, 1]
        s[S_RELAX] = q + dt * (growth - q * math.sqrt(abs(q)) / h[ROW.stress_relaxation, 2])


@compiled
def inertia(p: Floats, h: Floats) -> float:
    """Mass of the body in kg, with what it drags along."""
    return float(p[P_MASS] + h[ROW.added_mass, 0])
