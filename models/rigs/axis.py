"""A linear stage, or one that turns: its position is imposed, its force or torque is measured."""

import numpy as np

from models.rigs.columns import Columns, Range
from models.rigs.kind import Array, Record, RigKind, Tables
from models.rigs.tables import Axis


def _template(rng: np.random.Generator) -> tuple[Tables, Record]:
    """Motion at two frequencies, and the force of mass and friction that differ from the nominal ones, with noise."""
    t, x, v, a = _swings((0.05, 0.01))
    force = 95.0 * a + 210.0 * v + 22.0 * np.sign(v) + 0.5 * rng.standard_normal(t.size)
    nominal = {"mass_kg": 100.0, "viscous_friction_N_s_per_m": 200.0, "coulomb_friction_N": 20.0, "offset_N": 0.0}
    return {"rig": {"kind": AXIS.id}, "axis": nominal}, {"t_s": t, "position_m": x, "force_N": force}


def _turning_template(rng: np.random.Generator) -> tuple[Tables, Record]:
    """The same of a joint that turns by one and a half radians."""
    t, x, v, a = _swings((0.7, 0.1))
    torque = 0.38 * a + 1.25 * v + 2.1 * np.sign(v) + 0.05 * rng.standard_normal(t.size)
    nominal = {
        "inertia_kg_m2": 0.4,
        "viscous_friction_N_m_s_per_rad": 1.2,
        "coulomb_friction_N_m": 2.0,
        "offset_N_m": 0.0,
    }
    return {"rig": {"kind": AXIS.id}, "axis": nominal}, {"t_s": t, "angle_rad": x, "torque_N_m": torque}


def _swings(sizes: tuple[float, float]) -> tuple[Array, Array, Array, Array]:
    """Time, position, speed and acceleration of 20 s of a slow swing and a fast one, of these sizes."""
    t = np.arange(0, 20, 2e-3)
    turns = 2 * np.pi * np.array([[0.2], [0.5]])
    size = np.array(sizes)[:, None]
    x = np.sum(size * (1 - np.cos(turns * t)), axis=0)
    v, a = np.sum(size * turns * np.sin(turns * t), axis=0), np.sum(size * turns**2 * np.cos(turns * t), axis=0)
    return t, x, v, a


AXIS = RigKind(
    id="axis",
    layouts=(
        Columns((("position_m",),), ("force_N",), optional=("velocity_m_s", "load_N")),
        Columns((("angle_rad",),), ("torque_N_m",), optional=("velocity_rad_s", "load_N_m", "load_N")),
    ),
    ranges={
        "velocity_m_s": Range(-1e3, 1e3, "between -1000 and 1000 m/s"),
        "force_N": Range(-1e6, 1e6, "between -1e6 and 1e6 N"),
    },
    tables={"axis": Axis},
    template=_template,
    turning_template=_turning_template,
    wanted="more records, or one of at least four stretches of motion that last more than 0.4 s each",
    stage=True,
    hooks=frozenset({"level", "force", "measured", "delay"}),
    signals=frozenset({"t", "x", "v", "direction", "load"}),
)
