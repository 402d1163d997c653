"""The table `[belief]`: the rig file that the experimenter would have written, over nominal values."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Final

from models.laws.geometry import Capsule, Tissue
from models.parameter import nearest
from models.rigs.kinds import KINDS
from models.rigs.reader import parse_rig, table_names
from models.rigs.rig import Rig
from models.surfaces.plate import Plate

Table = Mapping[str, Any]
_CAPSULE: Final = asdict(Capsule())
_TISSUE: Final = {"preset": "jejunum", **asdict(Tissue())}
_PLATE: Final = Plate(0.0)


def read_belief(table: Table, kind: str, surface: str, magnets: Table | None = None) -> Rig:
    """What the controller is told of a rig: `[belief.*]` over nominal values. Raises ValueError."""
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
    own = KINDS[kind]
    told = table.get("rig", {}).get("magnet", None if "magnet_range_m" in table.get("rig", {}) else magnets)
    nominal: dict[str, Table] = {**own.nominal, "capsule": {**_CAPSULE, **own.nominal.get("capsule", {})}}
    nominal["rig"] = {"kind": kind, **(own.nominal.get("rig", {}) if told is None else {"magnet": told})}
    if surface == "gut":
        nominal["tissue"] = _TISSUE
    else:
        nominal["surface"] = {"kind": "plate", "friction_coefficient": _PLATE.friction_coefficient}
    if surface == "gut" and "surface" in own.tables:
        nominal["surface"] = {"kind": "gut"}
    if "lumen_diameter_m" in table.get("tissue", {}) and "tissue" in nominal:
        nominal["tissue"] = {key: value for key, value in nominal["tissue"].items() if key != "contact_angle_deg"}
    merged = {name: {**nominal.get(name, {}), **table.get(name, {})} for name in {**nominal, **table}}
    if merged["rig"]["kind"] != kind:
        raise ValueError(f"belief.rig.kind must be the plant's, {kind!r}; got {merged['rig']['kind']!r}")
    return parse_rig(merged, "belief")
