"""The table `[belief]`: the rig file that the experimenter would have written, over nominal values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from models.files.rig import TABLES as RIG_TABLES
from models.files.rig import Rig, parse_rig
from models.parameter import nearest

Table = Mapping[str, Any]
_CAPSULE: Final = {"radius_m": 6.5e-3, "cylinder_length_m": 20e-3, "mass_kg": 4.0e-3}
_TISSUE: Final = {
    "preset": "jejunum",
    "wall_thickness_m": 2.5e-3,
    "contact_angle_deg": 60.0,
    "nose_force_angle_deg": 30.0,
    "friction_coefficient": 0.082,
    "mucus_thickness_m": 30e-6,
    "recovery_time_s": 0.05,
}
_HEAD: Final[Mapping[str, Table]] = {
    "magnetic": {"magnet_stiffness_N_per_m": 25.0, "magnet_range_m": 0.02},
    "coil": {
        "force_constant_N_per_A": 0.5,
        "coil_resistance_Ohm": 10.0,
        "coil_inductance_H": 10e-3,
        "current_limit_A": 1.0,
    },
    "vibro": {},
}
_DRIVE: Final = {"inner_mass_kg": 0.074, "spring_stiffness_N_per_m": 256.23, "force_N": 1.25, "reaction_on_body": True}
_PLATE_BODY_KG: Final = 0.193
_PLATE_FRICTION: Final = 0.29


def read_belief(table: Table, kind: str, surface: str) -> Rig:
    """What the controller is told of a rig of `kind` on `surface`: `[belief.*]` over nominal values. Raises
    ValueError.
    """
    for name, content in table.items():
        if name not in RIG_TABLES:
            raise ValueError(
                f"tables of [belief] must be those of a rig file; got {name!r}; {nearest(name, RIG_TABLES)}"
            )
        if not isinstance(content, Mapping):
            raise ValueError(f"belief.{name} must be a table; got {content!r}")
    if "noise" in table:
        raise ValueError(
            "belief must have no table [belief.noise]: the filter has the noise it counts on from its drive"
        )
    capsule = dict(_CAPSULE)
    if kind == "vibro":
        capsule["mass_kg"] = _PLATE_BODY_KG
    nominal: dict[str, Table] = {"capsule": capsule, "rig": {"kind": kind, **_HEAD[kind]}}
    if kind != "vibro" or surface == "gut":
        nominal["tissue"] = _TISSUE
    if kind == "vibro":
        nominal["drive"] = _DRIVE
        nominal["surface"] = (
            {"kind": "gut"} if surface == "gut" else {"kind": "plate", "friction_coefficient": _PLATE_FRICTION}
        )
    merged = {name: {**nominal.get(name, {}), **table.get(name, {})} for name in {**nominal, **table}}
    if merged["rig"]["kind"] != kind:
        raise ValueError(f"belief.rig.kind must be the plant's, {kind!r}; got {merged['rig']['kind']!r}")
    return parse_rig(merged, "belief")
