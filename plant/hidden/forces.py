"""Hidden forces that act on the capsule beside resistance, film and wall; positive along +x."""

import math
from typing import Final

from plant.compiling import compiled
from plant.hidden.registry import ROWS
from plant.layout import P_MASS, P_WEIGHT, S_RELAX
from plant.tables import Floats

DAMPING: Final = ROWS["spring_damping"]
STOPS: Final = ROWS["end_stop_impact"]
STIFFENING: Final = ROWS["spring_stiffening"]
GUIDE: Final = ROWS["guide_rubbing"]
FIELD: Final = ROWS["coil_field"]
_LOSS = 1.5  # s/m, Hunt-Crossley damping of the hidden stops


@compiled
def suspension_force(r: float, rate: float, h: Floats) -> float:
    """Force in N that the hidden suspension puts on the inner mass against its offset `r` in m and `r'` in m/s,
    positive inwards.
    """
    force = 0.0
    if h[DAMPING, 0] != 0.0:
        force += h[DAMPING, 0] * rate * (1 + 2.0 * abs(rate))
    if h[STOPS, 0] != 0.0:
        if r > h[STOPS, 0]:
            force += max(h[STOPS, 1] * (r - h[STOPS, 0]) * (1 + _LOSS * rate), 0.0)
        elif r < -h[STOPS, 0]:
            force += min(h[STOPS, 1] * (r + h[STOPS, 0]) * (1 - _LOSS * rate), 0.0)
    if h[STIFFENING, 0] != 0.0:
        force += h[STIFFENING, 0] * r * (math.sqrt(1 + (r / h[STIFFENING, 1]) ** 2) - 1)
    if h[GUIDE, 0] != 0.0:
        force += h[GUIDE, 0] * rate / (abs(rate) + 3e-3) * (1 + 0.5 * math.exp(-abs(rate) / 0.15))
    return force


@compiled
def field_reach(r: float, h: Floats) -> float:
    """Factor on the coil's force on an inner mass at the offset `r` in m."""
    return float(1 - h[FIELD, 0] * math.tanh(r / h[FIELD, 1])) if h[FIELD, 0] != 0.0 else 1.0


VISCOUS: Final = ROWS["viscous_drag"]
PERISTALSIS: Final = ROWS["peristaltic_wave"]
RESPIRATION: Final = ROWS["respiration"]
INCLINE: Final = ROWS["incline_gravity"]
RELAXATION: Final = ROWS["stress_relaxation"]
ADDED_MASS: Final = ROWS["added_mass"]


@compiled
def hidden_force(x: float, v: float, t: float, s: Floats, p: Floats, h: Floats) -> float:
    """Sum of the hidden forces in N at place `x` in m, speed `v` in m/s, time `t` in s; the forms stand in the
    registry.
    """
    force = 0.0
    if h[VISCOUS, 0] != 0.0 and v != 0.0:
        force -= math.copysign(h[VISCOUS, 0] * (abs(v) * 100.0) ** 0.85, v)
    if h[PERISTALSIS, 0] != 0.0:
        force += h[PERISTALSIS, 0] * max(0.0, math.sin(2 * math.pi * (t / h[PERISTALSIS, 1] - x / h[PERISTALSIS, 2])))
    if h[RESPIRATION, 0] != 0.0:
        force += h[RESPIRATION, 0] * (2 * abs(math.cos(math.pi * t / h[RESPIRATION, 1])) ** 3 - 0.85)
    if h[INCLINE, 0] != 0.0:
        force -= p[P_WEIGHT] * math.sin(h[INCLINE, 0])
    if h[RELAXATION, 0] != 0.0:
        force -= h[RELAXATION, 0] * s[S_RELAX]
    return force


@compiled
def remember_stress(v: float, dt: float, s: Floats, h: Floats) -> None:
    """Advance the stress that builds up on the way and relaxes with a power of itself."""
    if h[RELAXATION, 0] != 0.0:
        q = s[S_RELAX]
        growth = (v - q * abs(v)) / h[RELAXATION, 1]
        s[S_RELAX] = q + dt * (growth - q * math.sqrt(abs(q)) / h[RELAXATION, 2])


@compiled
def inertia(p: Floats, h: Floats) -> float:
    """Mass of the body in kg, with what it drags along."""
    return float(p[P_MASS] + h[ADDED_MASS, 0])
