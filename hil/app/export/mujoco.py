"""A found model's friction as MuJoCo knows friction: a slide joint with frictionloss, damping and armature."""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hil.app.export.fmu_archive import filled
from hil.app.export.found import TEXT, Found, friction_table, not_mapped
from models.drives.axis_force import AxisForce
from models.drives.coil import Coil
from models.drives.magnetic import Magnetic
from models.drives.pull import Pull
from models.rigs.kinds import drive_of

Array = NDArray[np.float64]
_STEP_S: Final = 1e-3  # of MuJoCo's integrator
_KINDS: Final = (Magnetic.name, Pull.name, Coil.name, AxisForce.name)
_ANGLE: Final = "angle_rad"
_LIGHT_KG: Final = 1e-6  # of a body that turns: its inertia is the joint's armature
_HARD: Final = 0.9999
"""Impedance of friction, MuJoCo's largest: with its usual 0.9 a body of some grams would creep at centimetres a second
under forces far below `frictionloss`.
"""
_PULL_N_PER_M: Final = 1e4  # of the actuator that holds a position: stiff against friction


def body(found: Found) -> tuple[str, dict[str, float], dict[str, str]]:
    """MJCF text, fitted numbers (SI), and what is not in them: `frictionloss + damping |v|` is the least-squares line
    through the mean of the saw, `armature` the effect `added_mass`. Raises ValueError for an inner mass.
    """
    if found.rig.kind not in _KINDS:
        raise ValueError(f"rig.kind must be one of {', '.join(_KINDS)} for mujoco; got {found.rig.kind!r}")
    wound = found.drive.by_voltage
    if wound:
        found = replace(found, drive=drive_of(found.rig))
    table = friction_table(found)
    v, force = table["speed_m_s"], table["force_N"]
    damping, loss = _line(v, force)
    off = force - loss - damping * v
    own, turns = found.drive.inertia(found.numbers.base), found.drive.measured == _ANGLE
    numbers = {
        "mass_kg": found.surface.body_kg + found.drive.carried_kg + (_LIGHT_KG if turns else own),
        "frictionloss_N": loss,
        "damping_N_s_per_m": damping,
        "armature_kg": max(found.values.get(("added_mass", "mass_kg"), 0.0), 0.0) + (own if turns else 0.0),
        "rms_off_N": float(np.sqrt(np.mean(off**2))),
    }
    missing = {name: why for name, why in not_mapped(found).items() if name != "added_mass"}
    missing["friction over position and direction"] = TEXT("curvature", off=numbers["rms_off_N"])
    missing["drive"] = TEXT(f"drive.{found.rig.kind}")
    if wound:
        missing["winding"] = TEXT("drive.winding")
    return _mjcf(found, numbers), numbers, missing


def _line(v: Array, force: Array) -> tuple[float, float]:
    """Slope and value at rest of the line through `force` (n,) over `v` (n,), neither below zero as MuJoCo wants it."""
    slope, loss = np.polyfit(v, force, 1)
    if slope < 0:
        return 0.0, max(float(np.mean(force)), 0.0)
    return float(slope), max(float(loss), 0.0)


def _mjcf(found: Found, numbers: dict[str, float]) -> str:
    """The drive is a spring to the command for a magnet or a pull, else a force of the command's size."""
    drive, p, small = found.drive, found.numbers.base, 1e-6
    if drive.imposed:
        gain = f"{_PULL_N_PER_M:g}"
    elif drive.anchored:
        gain = f"{float(drive.force(0.0, 0.0, small, p)) / small:.9g}"
    else:
        none, one = (float(drive.force(0.0, 0.0, command / drive.command_unit, p)) for command in (0.0, 1.0))
        gain = f"{one - none:.9g}"
    own = {"gain": gain, "held": drive.imposed or drive.anchored, "turns": drive.measured == _ANGLE}
    return filled("mujoco.xml.j2", found=found, numbers=numbers, step_s=_STEP_S, hard=_HARD, **own)
