"""What the numbers of an axis are called: along a line, or about the axis itself."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final

from models.records.record import Record


@dataclass(frozen=True)
class Coordinates:
    """Names of an axis' columns and base parameters, and the units in which reports tell them."""

    position: str
    force: str
    velocity: str
    loads: tuple[str, ...]
    inertia: str
    viscous: str
    coulomb: str
    offset: str
    units: tuple[str, str, str, str]
    length_unit: str
    force_unit: str
    speed_unit: str
    turns: bool
    names: tuple[str, str, str, str]

    @property
    def base(self) -> tuple[str, str, str, str]:
        """Names of the base parameters."""
        return self.inertia, self.viscous, self.coulomb, self.offset

    def load_in(self, columns: Collection[str]) -> str | None:
        """The logged load among `columns`; None where there is none."""
        return next((name for name in self.loads if name in columns), None)


LINE: Final = Coordinates(
    position="position_m",
    force="force_N",
    velocity="velocity_m_s",
    loads=("load_N",),
    inertia="mass_kg",
    viscous="viscous_friction_N_s_per_m",
    coulomb="coulomb_friction_N",
    offset="offset_N",
    units=("kg", "N s/m", "N", "N"),
    length_unit="m",
    force_unit="N",
    speed_unit="m/s",
    turns=False,
    names=("x_m", "v_m_s", "a_m_s2", "force"),
)
TURN: Final = Coordinates(
    position="angle_rad",
    force="torque_N_m",
    velocity="velocity_rad_s",
    loads=("load_N_m", "load_N"),
    inertia="inertia_kg_m2",
    viscous="viscous_friction_N_m_s_per_rad",
    coulomb="coulomb_friction_N_m",
    offset="offset_N_m",
    units=("kg m2", "N m s/rad", "N m", "N m"),
    length_unit="rad",
    force_unit="N m",
    speed_unit="rad/s",
    turns=True,
    names=("x_rad", "v_rad_s", "a_rad_s2", "torque"),
)
_TOKENS: Final = {"m": "rad", "mm": "mrad", "m2": "rad2", "m3": "rad3", "N": "N_m"}


def coordinates_of(records: Sequence[Record]) -> Coordinates:
    """Those of `records`, of a line where there are none. Raises ValueError where they are not all of one."""
    found = {record.name: TURN if TURN.position in record.layout.own() else LINE for record in records}
    if len(set(found.values())) > 1:
        told = ", ".join(f"{name}: {one.position}" for name, one in found.items())
        raise ValueError(f"records of one axis must all have {LINE.position} or all {TURN.position}; got {told}")
    return next(iter(found.values()), LINE)


def turned_name(name: str) -> str:
    """A parameter's name about an axis: `speed_m_s` is `speed_rad_s`, `coefficient_N` is `coefficient_N_m`."""
    return "_".join(_TOKENS.get(token, token) for token in name.split("_"))


def turned_unit(unit: str) -> str:
    """A parameter's unit about an axis: `N/m` is `N m/rad`."""
    return re.sub(r"\b(N|mm|m)\b", lambda found: _TOKENS[found[1]].replace("_", " "), unit)
