"""Names and units of an axis's numbers: along a line, or about the axis itself."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final

from models.records.record import Record
from models.rigs.columns import LOADS
from models.surfaces import surface


@dataclass(frozen=True)
class Coordinates:
    """Names of columns; base parameters (inertia, viscous and Coulomb friction, offset) and their printed units; the
    unit of a length; names of position, speed, acceleration and force.
    """

    position: str
    force: str
    velocity: str
    loads: tuple[str, ...]
    base: tuple[str, str, str, str]
    units: tuple[str, str, str, str]
    length_unit: str
    names: tuple[str, str, str, str]

    @property
    def turns(self) -> bool:
        return self.length_unit == "rad"

    @property
    def force_unit(self) -> str:
        return self.units[2]

    def loads_in(self, columns: Collection[str]) -> dict[str, str]:
        """The logged inputs among `columns` by their names in parameters: the first of the axis' own is `load`."""
        found = [name for name in dict.fromkeys((*self.loads, *LOADS)) if name in columns]
        return {"load" if k == 0 and name in self.loads else name: name for k, name in enumerate(found)}


LINE: Final = Coordinates(
    "position_m",
    "force_N",
    "velocity_m_s",
    ("load_N",),
    surface.LINE.names,
    surface.LINE.units,
    "m",
    ("x_m", "v_m_s", "a_m_s2", "force"),
)
TURN: Final = Coordinates(
    "angle_rad",
    "torque_N_m",
    "velocity_rad_s",
    ("load_N_m", "load_N"),
    surface.TURN.names,
    surface.TURN.units,
    "rad",
    ("x_rad", "v_rad_s", "a_rad_s2", "torque"),
)
_TOKENS: Final = {"m": "rad", "mm": "mrad", "m2": "rad2", "m3": "rad3", "N": "N_m", "kg": "kg_m2"}


def coordinates_of(records: Sequence[Record]) -> Coordinates:
    """Those of `records`, of a line where there are none. Raises ValueError where they are not all of one."""
    found = {record.name: TURN if TURN.position in record.layout.own() else LINE for record in records}
    if len(set(found.values())) > 1:
        got = ", ".join(f"{name}: {one.position}" for name, one in found.items())
        raise ValueError(f"records of one axis must all have {LINE.position} or all {TURN.position}; got {got}")
    return next(iter(found.values()), LINE)


def turned_name(name: str) -> str:
    """A parameter's name about an axis: `speed_m_s` is `speed_rad_s`, `coefficient_N` is `coefficient_N_m`."""
    return "_".join(_TOKENS.get(token, token) for token in name.split("_"))


def turned_unit(unit: str) -> str:
    """A parameter's unit about an axis: `N/m` is `N m/rad`."""
    return re.sub(r"\b(N|mm|m|kg)\b", lambda found: _TOKENS[found[1]].replace("_", " "), unit)
