"""The seed papers' laws on dense even grids, read by a compiled step in a few nanoseconds."""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from models.laws.geometry import GRAVITY, Capsule, Tissue, stretched_length, wall_section
from models.laws.hyperelastic import WallConstants, wall_tension
from models.laws.resistance import environmental_resistance, mucus_drag, normal_load
from plant import layout as at
from plant.compiling import compiled

Floats = NDArray[np.float64]
_PER_SPEED = (at.NODES - 1) / at.SPEED_SPAN  # nodes of a table for each unit of its argument
_PER_ROOT = (at.NODES - 1) / at.MUCUS_SPAN
_PER_DRAG = (at.NODES - 1) / at.DRAG_SPAN


@lru_cache(maxsize=16)
def tabulate(capsule: Capsule, tissue: Tissue) -> Floats:
    """`rows[law, node]`: F_e(|v|), the pressure part of N(|v|), F_v over |w|^(1/4), T(u), u(T), SI, on the grids of
    `plant.layout`, within 1e-7 N, 2e-6 N about 20 mm/s where the moduli blend; shared and read-only. Raises
    `ValueError` if the wall's tension does not grow with its drag over the grid: u_c would not exist.
    """
    rows = np.empty((at.L_COUNT, at.NODES))
    speed = np.linspace(0.0, at.SPEED_SPAN, at.NODES)
    rows[at.L_RESISTANCE] = environmental_resistance(speed, capsule, tissue)
    rows[at.L_PRESSURE] = normal_load(speed, capsule, tissue) - capsule.mass_kg * GRAVITY
    slip = np.linspace(0.0, at.MUCUS_SPAN, at.NODES) ** 4
    rows[at.L_MUCUS, 0] = 0.0
    rows[at.L_MUCUS, 1:] = mucus_drag(slip[1:], tissue.mucus_thickness_m)
    drag = np.linspace(0.0, at.DRAG_SPAN, at.NODES)
    pull = wall_tension(drag, WallConstants.from_set(), wall_section(capsule, tissue), stretched_length(capsule))
    if not np.all(np.diff(pull) > 0):
        raise ValueError(f"wall tension must grow with the drag up to {at.DRAG_SPAN:g} m; got a law that does not")
    rows[at.L_TENSION] = pull
    rows[at.L_DRAG] = np.interp(np.linspace(0.0, pull[-1], at.NODES), pull, drag)
    rows.flags.writeable = False
    return rows


@compiled
def _read(rows: Floats, law: int, place: float) -> float:
    node = min(int(place), at.NODES - 2)
    low = rows[law, node]
    return float(low + (rows[law, node + 1] - low) * (place - node))


@compiled
def resistance(rows: Floats, speed: float) -> float:
    """`F_e(|v|)` in N."""
    return float(_read(rows, at.L_RESISTANCE, abs(speed) * _PER_SPEED))


@compiled
def pressure_load(rows: Floats, speed: float) -> float:
    """`cos(theta) I1 + I2` in N at `|v|`: the wall's part of N."""
    return float(_read(rows, at.L_PRESSURE, abs(speed) * _PER_SPEED))


@compiled
def film_drag(rows: Floats, slip: float) -> float:
    """`F_v(w)` in N, odd in the slip `w` in m/s."""
    drag = _read(rows, at.L_MUCUS, math.sqrt(math.sqrt(abs(slip))) * _PER_ROOT)
    return float(math.copysign(drag, slip))


@compiled
def tension(rows: Floats, drag: float) -> float:
    """`T(u)` in N, odd in the wall's drag `u` in m; linear beyond the grid."""
    return float(math.copysign(_read(rows, at.L_TENSION, abs(drag) * _PER_DRAG), drag))


@compiled
def drag_at(rows: Floats, force: float) -> float:
    """The drag `u` in m at which `T(u)` is `force` in N (not negative)."""
    top = rows[at.L_TENSION, at.NODES - 1]
    return float(_read(rows, at.L_DRAG, force * ((at.NODES - 1) / top)))
