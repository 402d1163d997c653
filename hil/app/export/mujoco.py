"""A found model's friction as MuJoCo knows friction: a slide joint with frictionloss, damping and armature."""

from typing import Final
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import NDArray

from hil.app.export.found import TEXT, Found
from hil.app.export.table import friction_table
from models.drives.axis_force import AxisForce
from models.drives.coil import Coil
from models.drives.magnetic import Magnetic
from models.drives.pull import Pull

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
    table = friction_table(found)
    v, force = table.columns["speed_m_s"], table.columns["force_N"]
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
    missing = {name: why for name, why in table.not_mapped.items() if name != "added_mass"}
    missing["friction over position and direction"] = TEXT("curvature", off=numbers["rms_off_N"])
    missing["drive"] = TEXT(f"drive.{found.rig.kind}")
    return _mjcf(found, numbers), numbers, missing


def _line(v: Array, force: Array) -> tuple[float, float]:
    """Slope and value at rest of the line through `force` (n,) over `v` (n,), neither below zero as MuJoCo wants it."""
    slope, loss = np.polyfit(v, force, 1)
    if slope < 0:
        return 0.0, max(float(np.mean(force)), 0.0)
    return float(slope), max(float(loss), 0.0)


def _mjcf(found: Found, numbers: dict[str, float]) -> str:
    root = Element("mujoco", model=f"{found.rig.kind} rig, {found.stage} model")
    SubElement(root, "option", timestep=f"{_STEP_S:g}", gravity="0 0 0", integrator="implicitfast")
    capsule = SubElement(SubElement(root, "worldbody"), "body", name="capsule")
    friction = {
        "frictionloss": f"{numbers['frictionloss_N']:.9g}",
        "damping": f"{numbers['damping_N_s_per_m']:.9g}",
        "armature": f"{numbers['armature_kg']:.9g}",
        "solreffriction": f"{2 * _STEP_S:g} 1",
        "solimpfriction": f"{_HARD} {_HARD} 0.001 0.5 2",
    }
    turns = found.drive.measured == _ANGLE
    SubElement(capsule, "joint", friction, name="lumen", type="hinge" if turns else "slide", axis="1 0 0")
    shape = found.rig.capsule
    solid = {
        "size": f"{shape.radius_m:.9g} {0.5 * shape.cylinder_length_m:.9g}",
        "quat": "0.7071068 0 0.7071068 0",
        "mass": f"{numbers['mass_kg']:.9g}",
    }
    SubElement(capsule, "geom", {"name": "capsule", "type": "capsule", **solid, "contype": "0", "conaffinity": "0"})
    _add_actuator(SubElement(root, "actuator"), found)
    sensor = SubElement(root, "sensor")
    SubElement(sensor, "jointpos", name=found.drive.measured, joint="lumen")
    SubElement(sensor, "jointvel", name=f"velocity_{'rad' if turns else 'm'}_s", joint="lumen")
    indent(root)
    return tostring(root, "unicode") + "\n"


def _add_actuator(actuator: Element, found: Found) -> None:
    """The drive: a spring to the command for a magnet or a pull, else a force of the command's size."""
    drive, p = found.drive, found.numbers.base
    own = {"name": drive.commanded, "joint": "lumen"}
    if drive.imposed:
        SubElement(actuator, "position", {**own, "kp": f"{_PULL_N_PER_M:g}"})
    elif drive.anchored:
        small = 1e-6
        SubElement(actuator, "position", {**own, "kp": f"{float(drive.force(0.0, 0.0, small, p)) / small:.9g}"})
    else:
        none, one = (float(drive.force(0.0, 0.0, command / drive.command_unit, p)) for command in (0.0, 1.0))
        SubElement(actuator, "motor", {**own, "gear": f"{one - none:.9g}"})
