"""The table `[belief]`: the rig file that the experimenter would have written, over nominal values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Final

from models.drives.coil import Coil, Winding
from models.drives.magnetic import Magnetic
from models.drives.vibro import Vibro
from models.laws.geometry import Capsule, Tissue
from models.parameter import nearest
from models.rigs.reader import parse_rig, table_names
from models.rigs.rig import Rig
from models.surfaces.plate import Plate

Table = Mapping[str, Any]
_CAPSULE: Final = asdict(Capsule())
_TISSUE: Final = {"preset": "jejunum", **asdict(Tissue())}
_MAGNET, _COIL, _WINDING, _VIBRO, _PLATE = Magnetic(), Coil(), Winding(), Vibro(), Plate(0.193)
"""Nominal numbers are those that the models declare; the plate's body is the capsubot's."""
_HEAD: Final[Mapping[str, Table]] = {
    "magnetic": {"magnet_stiffness_N_per_m": _MAGNET.stiffness_N_per_m, "magnet_range_m": _MAGNET.range_m},
    "coil": {
        "force_constant_N_per_A": _COIL.force_constant_N_per_A,
        "coil_resistance_Ohm": _WINDING.resistance_ohm,
        "coil_inductance_H": _WINDING.inductance_H,
        "current_limit_A": _WINDING.current_limit_A,
    },
    "vibro": {},
}
_NUMBERS: Final = ("inner_mass_kg", "spring_stiffness_N_per_m", "force_N", "reaction_on_body")
_DRIVE: Final = {name: getattr(_VIBRO, name) for name in _NUMBERS}


def read_belief(table: Table, kind: str, surface: str, magnets: Table | None = None) -> Rig:
    """What the controller is told of a rig of `kind` on `surface`: `[belief.*]` over nominal values, those of a pair of
    magnets being its data sheet's, `[rig.magnet]`. Raises ValueError.
    """
    for name, content in table.items():
        if name not in table_names():
            raise ValueError(
                f"tables of [belief] must be those of a rig file; got {name!r}; {nearest(name, table_names())}"
            )
        if not isinstance(content, Mapping):
            raise ValueError(f"belief.{name} must be a table; got {content!r}")
    if "noise" in table:
        raise ValueError(
            "belief must have no table [belief.noise]: the filter has the noise it counts on from its drive"
        )
    capsule = dict(_CAPSULE)
    if kind == "vibro":
        capsule["mass_kg"] = _PLATE.mass_kg
    told = table.get("rig", {}).get("magnet", None if "magnet_range_m" in table.get("rig", {}) else magnets)
    head = _HEAD[kind] if told is None else {"magnet": told}
    nominal: dict[str, Table] = {"capsule": capsule, "rig": {"kind": kind, **head}}
    if surface == "gut":
        nominal["tissue"] = _TISSUE
    if kind == "vibro":
        nominal["drive"] = _DRIVE
    if surface != "gut":
        nominal["surface"] = {"kind": "plate", "friction_coefficient": _PLATE.friction_coefficient}
    elif kind == "vibro":
        nominal["surface"] = {"kind": "gut"}
    if "lumen_diameter_m" in table.get("tissue", {}) and "tissue" in nominal:
        nominal["tissue"] = {key: value for key, value in nominal["tissue"].items() if key != "contact_angle_deg"}
    merged = {name: {**nominal.get(name, {}), **table.get(name, {})} for name in {**nominal, **table}}
    if merged["rig"]["kind"] != kind:
        raise ValueError(f"belief.rig.kind must be the plant's, {kind!r}; got {merged['rig']['kind']!r}")
    return parse_rig(merged, "belief")
