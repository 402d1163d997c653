"""A found model's friction as MuJoCo knows friction: a slide joint with frictionloss, damping and armature."""

from typing import Final
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from hil.app.export.found import Found
from hil.app.export.table import friction_table
from models.drives.coil import Coil
from models.drives.magnetic import Magnetic
from models.drives.pull import Pull

Array = NDArray[np.float64]
_STEP_S: Final = 1e-3  # of MuJoCo's integrator
_DRIVES: Final = {
    Magnetic.name: "the magnet's force beyond small gaps: the actuator is a linear spring of its stiffness",
    Pull.name: "the elastic link of a pull, where there is one: the actuator holds the place stiffly",
    Coil.name: "the coil's reach along the lumen: the actuator's force is that at place 0",
}
_HARD: Final = 0.9999
"""Impedance of friction, MuJoCo's largest: with its usual 0.9 a body of some grams would creep at centimetres a second
under forces far below `frictionloss`.
"""
_PULL_N_PER_M: Final = 1e4  # of the actuator that holds a place: stiff against friction


def body(found: Found) -> tuple[str, dict[str, float], dict[str, str]]:
    """MJCF text, fitted numbers (SI), and what is not in them: `frictionloss + damping |v|` is the least-squares line
    through the mean of the saw, `armature` the effect `added_mass`. Raises ValueError for an inner mass.
    """
    if found.rig.kind not in _DRIVES:
        raise ValueError(f"rig.kind must be one of {', '.join(_DRIVES)} for mujoco; got {found.rig.kind!r}")
    table = friction_table(found)
    v, force = table.columns["speed_m_s"], table.columns["force_N"]
    damping, loss = _line(v, force)
    off = force - loss - damping * v
    numbers = {
        "mass_kg": found.surface.body_kg + found.drive.carried_kg,
        "frictionloss_N": loss,
        "damping_N_s_per_m": damping,
        "armature_kg": max(found.values.get(("added_mass", "mass_kg"), 0.0), 0.0),
        "rms_off_N": float(np.sqrt(np.mean(off**2))),
    }
    missing = {name: why for name, why in table.not_mapped.items() if name != "added_mass"}
    off_mN = 1e3 * numbers["rms_off_N"]
    missing["friction over place and direction"] = f"and its curvature over speed: rms {off_mN:.3g} mN"
    missing["drive"] = _DRIVES[found.rig.kind]
    return _mjcf(found, numbers), numbers, missing


def _line(v: Array, force: Array) -> tuple[float, float]:
    """Slope and value at rest of the line through `force` (n,) over `v` (n,), neither below zero as MuJoCo wants it."""
    slope, loss = np.polyfit(v, force, 1)
    if slope < 0:
        return 0.0, max(float(np.mean(force)), 0.0)
    return float(slope), max(float(loss), 0.0)


def _mjcf(found: Found, numbers: dict[str, float]) -> str:
    radius, half = found.rig.capsule.radius_m, 0.5 * found.rig.capsule.cylinder_length_m
    joint = (
        f'<joint name="lumen" type="slide" axis="1 0 0" frictionloss="{numbers["frictionloss_N"]:.9g}"'
        f' damping="{numbers["damping_N_s_per_m"]:.9g}" armature="{numbers["armature_kg"]:.9g}"'
        f' solreffriction="{2 * _STEP_S:g} 1" solimpfriction="{_HARD} {_HARD} 0.001 0.5 2"/>'
    )
    geom = (
        f'<geom name="capsule" type="capsule" size="{radius:.9g} {half:.9g}" quat="0.7071068 0 0.7071068 0"'
        f' mass="{numbers["mass_kg"]:.9g}" contype="0" conaffinity="0"/>'
    )
    return f"""\
<mujoco model={quoteattr(f"{found.rig.kind} rig, {found.stage} model")}>
  <option timestep="{_STEP_S:g}" gravity="0 0 0" integrator="implicitfast"/>
  <worldbody>
    <body name="capsule">
      {joint}
      {geom}
    </body>
  </worldbody>
  <actuator>
    {_actuator(found)}
  </actuator>
  <sensor>
    <jointpos name="position_m" joint="lumen"/>
    <jointvel name="velocity_m_s" joint="lumen"/>
  </sensor>
</mujoco>
"""


def _actuator(found: Found) -> str:
    """The drive: a spring to the command for a magnet or a pull, else a force of the command's size."""
    drive, p = found.drive, found.numbers.base
    name = quoteattr(drive.commanded)
    if drive.imposed:
        return f'<position name={name} joint="lumen" kp="{_PULL_N_PER_M:g}"/>'
    if drive.anchored:
        small = 1e-6
        stiffness = float(drive.force(0.0, 0.0, small, p)) / small
        return f'<position name={name} joint="lumen" kp="{stiffness:.9g}"/>'
    gear = float(drive.force(0.0, 0.0, 1.0 / drive.command_unit, p))
    return f'<motor name={name} joint="lumen" gear="{gear:.9g}"/>'
